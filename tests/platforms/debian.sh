#!/usr/bin/env bash
# What `make demo` and `make test` do on a fresh Debian, as a user finds it: a normal user without rights, a path
# with spaces, started under nohup, and a second time without network.
#
#   debian.sh SUITE demo    make demo twice; how long it took without downloads, and how large the installation is
#   debian.sh SUITE check   demo, then every test of core that is not slow
#   debian.sh SUITE test    demo, then make test, whole
#
# SUITE is bookworm (Debian 12, Python 3.11), trixie (Debian 13, 3.13) or sid (3.14). Needs root, debootstrap and 2 GB in
# $XDG_CACHE_HOME/toposeam/platform-<suite>, which keeps the system and pip's downloads; the checkout is copied anew
# each time. DEBIAN_MIRROR is the mirror. Mounts live in a namespace of the command and vanish with it.
set -euo pipefail

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
suite=${1:-} what=${2:-demo}
case "$suite:$what" in
    bookworm:demo | bookworm:check | bookworm:test | trixie:demo | trixie:check | trixie:test | sid:demo | sid:check | sid:test) ;;
    *) sed -n '2,12s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
cache=${XDG_CACHE_HOME:-$HOME/.cache}/toposeam
root=$cache/platform-$suite
log=$cache/platform-$suite.log
place="/home/maker/my work/TopoSeam"
say() { echo "platforms: $suite: $*" >&2; }
fail() { say "$*"; exit 1; }

[ "$(id -u)" = 0 ] || fail "making a system in a folder takes root"
command -v debootstrap >/dev/null || fail "debootstrap is missing; install it"

inside() { # NETWORK (yes or no) COMMAND…
    local alone=()
    [ "$1" = yes ] || alone=(--net)
    shift
    # shellcheck disable=SC2016
    unshare --mount --propagation private "${alone[@]}" bash -c '
        set -e
        root=$1; shift
        mount --rbind /dev "$root/dev"
        mount --rbind /proc "$root/proc"
        cp -L /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true
        cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/trusted.crt" 2>/dev/null || true
        exec chroot "$root" "$@"' inside "$root" \
        env -i LANG=C.UTF-8 TERM=dumb DEBIAN_FRONTEND=noninteractive PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" no_proxy="${no_proxy:-}" "$@"
}

as_user() { # NETWORK COMMAND, in the copied checkout, under nohup
    inside "$1" su maker -s /bin/sh -c "cd '$place' && SSL_CERT_FILE=/etc/ssl/trusted.crt PIP_CERT=/etc/ssl/trusted.crt nohup nice sh -c '$2' </dev/null"
}

mkdir -p "$cache"
exec 9>"$root.lock"
flock 9
if [ ! -e "$root/.ready" ]; then
    say "a fresh system goes into $root"
    rm -rf "$root" "$root.part"
    mirror=${DEBIAN_MIRROR:-$({ grep -rhoE 'https?://[^ ]+/debian/?( |$)' /etc/apt/sources.list /etc/apt/sources.list.d 2>/dev/null || true; } | grep -v snapshot | head -n 1 | tr -d ' ')}
    debootstrap --variant=minbase "$suite" "$root.part" "${mirror:-http://deb.debian.org/debian}" >"$log" 2>&1 || fail "debootstrap failed: $(tail -n 1 "$log") (more in $log)"
    mv "$root.part" "$root"
    inside yes sh -c 'apt-get -o Acquire::Check-Valid-Until=false update && apt-get install -y --no-install-recommends python3-venv make && apt-get clean && useradd --create-home maker' \
        >>"$log" 2>&1 || fail "apt-get failed: $(tail -n 1 "$log") (more in $log)"
    touch "$root/.ready"
fi

rm -rf "${root:?}$place"
mkdir -p "$root$place"
(cd "$checkout" && git ls-files -z --cached --others --exclude-standard | tar --null --ignore-failed-read -cf - -T -) | tar -C "$root$place" -xf -
inside yes chown -R maker: /home/maker

say "$(inside yes python3 --version)"
as_user yes "make demo" >"$log.demo" 2>&1 || { tail -n 20 "$log.demo"; fail "make demo failed"; }
as_user no "rm -r demo; make demo" >"$log.again" 2>&1 || { tail -n 20 "$log.again"; fail "make demo without network failed"; }
[ -s "$root$place/demo/joined.png" ] || fail "make demo made no joined.png"
say "make demo passes, and again without network"
say "installed: $(du -sm "$root$place/.venv" | cut -f1) MB"

# How long it takes from nothing, downloads excluded: everything is in pip's cache now.
rm -rf "$root$place/.venv" "$root$place/demo"
TIMEFORMAT="%R s, of which the processor worked %U + %S s"
three() {
    as_user yes "python3 -m venv .venv && .venv/bin/pip install -q . && .venv/bin/toposeam stitch samples/grass_a.png samples/grass_b.png --overlap 40 -o joined.png" >"$log.three" 2>&1
}
took=$({ time three; } 2>&1) || { tail -n 20 "$log.three"; fail "three commands failed"; }
say "from nothing to a joined picture by three commands: $took"
say "import toposeam: $(as_user no ".venv/bin/python -c \"import time; t = time.process_time(); import toposeam; print(round(time.process_time() - t, 3))\"" 2>/dev/null) s of processor time"

rm -rf "$root$place/.venv"
case $what in
    check)
        as_user yes "python3 -m venv .venv && .venv/bin/pip install -q --editable .[test] && OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest tests/core -q -n 2 -m \"not slow\"" >"$log.check" 2>&1 ||
            { tail -n 40 "$log.check"; fail "the quick core tests failed"; }
        say "quick core tests: $(tail -n 1 "$log.check")" ;;
    test)
        as_user yes "make test" >"$log.test" 2>&1 || { tail -n 40 "$log.test"; fail "make test failed"; }
        say "make test: $(tail -n 1 "$log.test")" ;;
esac
