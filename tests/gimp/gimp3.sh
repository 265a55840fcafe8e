#!/usr/bin/env bash
# A GIMP 3 for the tests: the system's where it has one, else Debian's in a folder of its own.
#
#   gimp3.sh provide          install it if need be (about three minutes, 1.8 GB, root; resumes after an interruption)
#   gimp3.sh run COMMAND…     run a command from the checkout's root where `gimp-console-3.x`, `Xvfb` and `python` (with toposeam) are on PATH
#   gimp3.sh where            say which GIMP that is
#
# GIMP_SUITE=trixie|sid picks Debian's GIMP 3.0 or the newest one, and then the system's is not looked at. GIMP_MIRROR is the Debian mirror.
# A mirror that lags behind (its signed list has expired) is good enough for tests. The folder is $XDG_CACHE_HOME/toposeam/gimp-<suite>;
# delete it to start anew. Mounts live in a namespace of the command and vanish with it.
set -euo pipefail

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
suite=${GIMP_SUITE:-trixie}
cache=${XDG_CACHE_HOME:-$HOME/.cache}/toposeam
root=$cache/gimp-$suite
packages="gimp python3-gi python3-venv gir1.2-gtk-3.0 xvfb xdotool imagemagick openbox fonts-dejavu-core fonts-noto-cjk icc-profiles-free gettext make locales"
python=${PYTHON:-python3}

say() { echo "gimp3: $*" >&2; }
fail() { say "$*"; exit 3; }

system_gimp() {
    [ -z "${GIMP_SUITE:-}" ] || return 1
    compgen -c gimp-console-3 | head -n 1 | grep . && command -v Xvfb >/dev/null
}

inside() { # COMMAND…, in the folder's root, with the checkout at /checkout
    # shellcheck disable=SC2016
    unshare --mount --propagation private bash -c '
        set -e
        root=$1 checkout=$2; shift 2
        mount --rbind /dev "$root/dev"
        mount --rbind /proc "$root/proc"
        mkdir -p "$root/checkout"
        mount --bind "$checkout" "$root/checkout"
        cp -L /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true
        cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/trusted.crt" 2>/dev/null || true # a network with a certificate of its own
        exec chroot "$root" "$@"' inside "$root" "$checkout" \
        env -i HOME=/root LANG=C.UTF-8 LC_ALL=C.UTF-8 TERM="${TERM:-dumb}" DEBIAN_FRONTEND=noninteractive \
        PATH=/opt/toposeam/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        SSL_CERT_FILE=/etc/ssl/trusted.crt PIP_CERT=/etc/ssl/trusted.crt PIP_ROOT_USER_ACTION=ignore PIP_DISABLE_PIP_VERSION_CHECK=1 OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
        http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" no_proxy="${no_proxy:-}" \
        ${TOPOSEAM_GIMP_REQUIRED:+TOPOSEAM_GIMP_REQUIRED=$TOPOSEAM_GIMP_REQUIRED} "$@"
}

mirror() {
    [ -z "${GIMP_MIRROR:-}" ] || { echo "$GIMP_MIRROR"; return; }
    { grep -rhoE 'https?://[^ ]+/debian/?( |$)' /etc/apt/sources.list /etc/apt/sources.list.d 2>/dev/null || true; } |
        grep -v snapshot | head -n 1 | tr -d ' ' | grep . || echo http://deb.debian.org/debian
}

provide() {
    if found=$(system_gimp); then say "the system has $found"; return; fi
    [ "$(id -u)" = 0 ] || fail "this system has no GIMP 3 (or no Xvfb); install both, or run 'make gimp' as root to put Debian's into $root"
    mkdir -p "$cache"
    exec 9>"$cache/gimp-$suite.lock"
    flock 9
    if [ ! -e "$root/.ready-base" ]; then
        if ! command -v debootstrap >/dev/null; then
            command -v apt-get >/dev/null || fail "debootstrap is missing; install it"
            apt-get install -y --no-install-recommends debootstrap >&2 || { apt-get update >&2 && apt-get install -y --no-install-recommends debootstrap >&2; }
        fi
        rm -rf "$root" "$root.part"
        say "Debian $suite goes into $root"
        debootstrap --variant=minbase "$suite" "$root.part" "$(mirror)" >"$cache/gimp-$suite.log" 2>&1 ||
            fail "debootstrap failed: $(tail -n 1 "$cache/gimp-$suite.log") (more in $cache/gimp-$suite.log)"
        touch "$root.part/.ready-base"
        mv "$root.part" "$root"
    fi
    if [ "$(cat "$root/.ready-packages" 2>/dev/null)" != "$packages" ]; then
        say "installing GIMP there"
        # shellcheck disable=SC2086
        inside sh -c 'dpkg --configure -a && apt-get -o Acquire::Check-Valid-Until=false update && apt-get install -y --no-install-recommends "$@" && apt-get clean' sh $packages \
            >>"$cache/gimp-$suite.log" 2>&1 || fail "apt-get failed inside: $(tail -n 1 "$cache/gimp-$suite.log") (more in $cache/gimp-$suite.log)"
        echo "$packages" >"$root/.ready-packages"
    fi
    wanted=$(sha256sum <"$checkout/pyproject.toml")
    if [ "$(cat "$root/.ready-python" 2>/dev/null)" != "$wanted" ]; then
        say "installing toposeam's dependencies there"
        inside sh -c 'test -x /opt/toposeam/bin/pip || python3 -m venv --clear /opt/toposeam; 
            cd /checkout && pip install --quiet --editable '\''.[cli]'\'' pytest pytest-timeout
            pip install --quiet --only-binary :all: "PyMaxflow>=1.3" || echo "PyMaxflow has no wheel for this Python"' \
            >>"$cache/gimp-$suite.log" 2>&1 || fail "pip failed inside: $(tail -n 1 "$cache/gimp-$suite.log") (more in $cache/gimp-$suite.log)"
        echo "$wanted" >"$root/.ready-python"
    fi
    flock -u 9
}

run() {
    if system_gimp >/dev/null; then
        cd "$checkout"
        PATH=$(dirname "$(command -v "$python")"):$PATH exec "$@"
    fi
    [ -e "$root/.ready-python" ] || fail "there is no GIMP 3 here; 'make gimp' provides one"
    inside sh -c 'cd /checkout && exec "$@"' sh "$@"
}

case ${1:-} in
    provide) provide ;;
    run) shift; run "$@" ;;
    where) if found=$(system_gimp); then echo "the system's $found"; else run sh -c 'echo "GIMP $(dpkg-query -W -f "\${Version}" gimp) of Debian, in a folder of its own"'; fi ;;
    *) sed -n '2,11s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
