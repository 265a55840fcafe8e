#!/usr/bin/env bash
# What `make demo` and `make test` do on a fresh Debian or Ubuntu, as a user finds it: a normal user without rights, a
# path with spaces, started under nohup, and a second time without network.
#
#   debian.sh SUITE three     README's three commands: how long they take without downloads, how large it gets
#   debian.sh SUITE demo      make demo twice, and the three commands
#   debian.sh SUITE check     demo, then every test that is not slow
#   debian.sh SUITE test      demo, then make test, whole, and that it begins again without network
#   debian.sh SUITE only …    after check or test: a command there, such as .venv/bin/python -m pytest tests/cli
#
# SUITE is bookworm (Debian 12, Python 3.11), noble (Ubuntu 24.04, 3.12), trixie (Debian 13, 3.13) or sid (3.14). Needs
# root, debootstrap and 4 GB in $XDG_CACHE_HOME/toposeam/platform-<suite>, which keeps the system and pip's downloads;
# the checkout is copied anew each time. DEBIAN_MIRROR and UBUNTU_MIRROR are the mirrors. Mounts live in a namespace of
# the command and vanish with it.
set -euo pipefail
{ # read whole before it runs

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
suite=${1:-} what=${2:-demo}
case "$suite:$what" in
    bookworm:* | noble:* | trixie:* | sid:*) ;;
    *) what= ;;
esac
case "$what" in
    three | demo | check | test | only) ;;
    *) sed -n '2,15s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
cache=${XDG_CACHE_HOME:-$HOME/.cache}/toposeam
root=$cache/platform-$suite
log=$cache/platform-$suite.log
place="/home/maker/my work/TopoSeam"
[ "$what" != three ] || place="/home/maker/my work/three commands" # beside what is tested there
say() { echo "platforms: $suite: $*" >&2; }
fail() { say "$*"; exit 1; }

[ "$(id -u)" = 0 ] || fail "making a system in a folder takes root"
command -v debootstrap >/dev/null || fail "debootstrap is missing; install it"

inside() { # NETWORK (yes or no) COMMAND…
    local alone=() network=$1
    shift
    [ "$network" = yes ] || alone=(--net)
    # shellcheck disable=SC2016
    unshare --mount --propagation private "${alone[@]}" bash -c '
        set -e
        root=$1; shift
        [ "$1" = yes ] || ip link set lo up # a machine without network still has itself
        shift
        mount --rbind /dev "$root/dev"
        mount --rbind /proc "$root/proc"
        cp -L /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true
        cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/trusted.crt" 2>/dev/null || true
        exec chroot "$root" "$@"' inside "$root" "$network" \
        env -i LANG=C.UTF-8 TERM=dumb DEBIAN_FRONTEND=noninteractive PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" no_proxy="${no_proxy:-}" "$@"
}

as_user() { # NETWORK COMMAND, in the copied checkout, under nohup
    inside "$1" su maker -s /bin/sh -c "cd '$place' && SSL_CERT_FILE=/etc/ssl/trusted.crt PIP_CERT=/etc/ssl/trusted.crt nohup sh -c '$2' </dev/null"
}

mkdir -p "$cache"
exec 9>"$root.lock"
flock 9
if [ ! -e "$root/.ready" ]; then
    say "a fresh system goes into $root"
    rm -rf "$root" "$root.part"
    if [ "$suite" = noble ]; then
        keys=/usr/share/keyrings/ubuntu-archive-keyring.gpg
        [ -e "$keys" ] && from=(--keyring="$keys") || { say "without ubuntu-keyring nobody checks who signed it"; from=(--no-check-gpg); }
        from+=(--components=main,universe noble "$root.part" "${UBUNTU_MIRROR:-http://archive.ubuntu.com/ubuntu}" /usr/share/debootstrap/scripts/gutsy)
    else
        mirror=${DEBIAN_MIRROR:-$({ grep -rhoE 'https?://[^ ]+/debian/?( |$)' /etc/apt/sources.list /etc/apt/sources.list.d 2>/dev/null || true; } | grep -v snapshot | head -n 1 | tr -d ' ')}
        from=("$suite" "$root.part" "${mirror:-http://deb.debian.org/debian}")
    fi
    debootstrap --variant=minbase "${from[@]}" >"$log" 2>&1 || fail "debootstrap failed: $(tail -n 1 "$log") (more in $log)"
    mv "$root.part" "$root"
    inside yes sh -c 'apt-get -o Acquire::Check-Valid-Until=false update && apt-get install -y --no-install-recommends python3-venv make && apt-get clean && useradd --create-home maker' \
        >>"$log" 2>&1 || fail "apt-get failed: $(tail -n 1 "$log") (more in $log)"
    touch "$root/.ready"
fi

[ "$what" = only ] || rm -rf "${root:?}$place"
mkdir -p "$root$place"
(cd "$checkout" && git ls-files -z --cached --others --exclude-standard | tar --null --ignore-failed-read -cf - -T -) | tar -C "$root$place" -xf -
inside yes chown -R maker: /home/maker
if [ "$what" = only ]; then
    shift 2
    as_user yes "$*"
    exit
fi

say "$(inside yes python3 --version)"
if [ "$what" != three ]; then
    as_user yes "make demo" >"$log.demo" 2>&1 || { tail -n 20 "$log.demo"; fail "make demo failed"; }
    as_user no "rm -r demo; make demo" >"$log.again" 2>&1 || { tail -n 20 "$log.again"; fail "make demo without network failed"; }
    [ -s "$root$place/demo/joined.png" ] || fail "make demo made no joined.png"
    say "make demo passes, and again without network"
fi

# How good it promises to be: from nothing to a joined picture by three commands in a minute, downloads excluded, at most
# 350 MB, `import toposeam` in 0.05 s. Everything is downloaded first; what is measured runs without network.
rm -rf "$root$place/.venv" "$root$place/demo"
cat >"$root$place/../needed.py" <<'EOF'
import pathlib, tarfile, tomllib  # what the source archives among the downloads need to be built
for path in pathlib.Path("../wheels").glob("*.tar.gz"):
    with tarfile.open(path) as archive:
        project = archive.extractfile(path.name.removesuffix(".tar.gz") + "/pyproject.toml").read().decode()
    print(*tomllib.loads(project)["build-system"]["requires"], sep="\n")
EOF
as_user yes "python3 -m venv ../loader && ../loader/bin/pip download -q -d ../wheels .[cli] hatchling hatch-fancy-pypi-readme && ../loader/bin/python ../needed.py >../needed.txt && ../loader/bin/pip download -q -d ../wheels -r ../needed.txt" >"$log.three" 2>&1 ||
    { tail -n 20 "$log.three"; fail "downloading failed"; }
TIMEFORMAT="%R %U %S"
three() {
    as_user no "python3 -m venv .venv && .venv/bin/pip install -q --no-compile --no-cache-dir --no-index --find-links ../wheels .[cli] && .venv/bin/toposeam stitch samples/portrait_left.jpg samples/portrait_right.jpg -o first.jpg" >>"$log.three" 2>&1
}
took=$({ time three; } 2>&1) || { tail -n 20 "$log.three"; fail "three commands failed"; }
[ -s "$root$place/first.jpg" ] || fail "three commands made no first.jpg"
read -r clock user system <<<"$took"
size=$(du -sm "$root$place/.venv" | cut -f1)
echo 'import time
c, p = time.perf_counter(), time.process_time()
import toposeam
print(f"{time.process_time() - p:.3f} {time.perf_counter() - c:.3f}")' >"$root$place/../import.py"
imported=$(as_user no "for i in 1 2 3 4 5 6 7; do .venv/bin/python ../import.py; done" 2>/dev/null | sort -n | head -n 1)
say "from nothing to a joined picture by three commands: $clock s by the clock, of which the processor worked $user + $system s"
as_user no ".venv/bin/python -m compileall -q .venv" >>"$log.three" 2>&1 || true # templates among what is installed are no Python
compiled=$(du -sm "$root$place/.venv" | cut -f1)
empty=$(du -sm "$root$place/../loader" | cut -f1) # what Python's venv puts there by itself: pip, on Debian 12 setuptools too
say "clean installation: $size MB on the disk, pip and all; all of it compiled $compiled MB, of which an empty environment has $empty MB"
say "import toposeam: ${imported% *} s of processor time, ${imported#* } s by the clock (best of 7)"
awk -v t="$user" -v s="$system" -v m="$size" -v c="$((compiled - empty))" -v i="${imported% *}" 'BEGIN { exit !(t + s <= 60 && m <= 350 && c <= 350 && i <= 0.05) }' ||
    fail "that is more than 60 s of processor time, 350 MB or 0.05 s"
[ "$what" != three ] || exit 0

rm -rf "$root$place/.venv"
case $what in
    check)
        as_user yes "make .venv/.ready && OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 .venv/bin/python -m pytest -q -n ${TESTS_AT_ONCE:-2} -m \"not slow\"" >"$log.check" 2>&1 ||
            { tail -n 40 "$log.check"; fail "the quick tests failed"; }
        say "quick tests: $(tail -n 1 "$log.check")" ;;
    test)
        as_user yes "make test" >"$log.test" 2>&1 || { tail -n 40 "$log.test"; fail "make test failed"; }
        say "make test: $(tail -n 1 "$log.test")"
        as_user no "PYTEST_ADDOPTS=tests/test_house.py make test" >"$log.test.again" 2>&1 ||
            { tail -n 40 "$log.test.again"; fail "make test without network failed"; }
        say "make test begins without network too" ;;
esac
exit
}
