#!/bin/sh
# dependencies.sh [--check] GROUP...   have the Debian packages of these groups: build, test.
#
# Silent and quick when all are there. Else, as root or with sudo that asks nothing, install them (network needed);
# otherwise say in one line what to run, and fail. --check never installs; where there is no dpkg it says nothing, since
# the libraries may have come another way.
set -u

# gcc only recommends libc6-dev, and minimal machines take no recommendations.
build='gcc libc6-dev make pkg-config
    libsuitesparse-dev libopenblas-dev liblapacke-dev libgsl-dev
    libgmsh-dev libyaml-dev libexpat1-dev zlib1g-dev libjson-c-dev
    libwebsockets-dev libssl-dev libjs-three'
test='libcmocka-dev libccd-dev python3 clang-format cppcheck chromium chromium-driver gcc-arm-none-eabi
    clang lld qemu-system-arm valgrind user-mode-linux kmod iproute2 can-utils'

die()
{
    echo "dependencies: $*" >&2
    exit 1
}

check=
[ "${1-}" = --check ] && check=yes && shift
[ $# -ge 1 ] || die "usage: dependencies.sh [--check] build|test..."
wanted=
for group; do
    case $group in
    build) wanted="$wanted $build" ;;
    test) wanted="$wanted $test" ;;
    *) die "no group named '$group'; there are build and test" ;;
    esac
done

if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
    [ "$check" ] && exit 0
    die "this is not a Debian system; install the equivalents of:" $wanted
fi

missing()
{
    # dpkg-query fails on names it has never seen; what counts is which ones are installed
    have=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' $wanted 2>/dev/null | sed -n 's/^installed //p')
    for package in $wanted; do
        case "
$have
" in
        *"
$package
"*) ;;
        *) printf ' %s' "$package" ;;
        esac
    done
}

lacking=$(missing)
[ -z "$lacking" ] && exit 0
command="apt-get install -y --no-install-recommends$lacking"
[ "$check" ] && die "packages are missing; run: $command   (or, as root: make deps)"

if [ "$(id -u)" -eq 0 ]; then
    as_root=
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root='sudo -n'
else
    die "packages are missing and this user may not install them; run as root: apt-get update && $command"
fi

log=$(mktemp) || die "no temporary file can be made"
trap 'rm -f "$log"' EXIT
trap 'exit 130' INT TERM
echo "dependencies: installing$lacking" >&2
apt()
{
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 \
        -o Acquire::Retries=2 -o Acquire::http::Timeout=60 "$@" </dev/null >>"$log" 2>&1
}
# A failed update of one source need not matter: the install below decides.
apt update
if ! apt install -y --no-install-recommends $lacking || [ -n "$(missing)" ]; then
    reason=$(grep '^E: ' "$log" | tail -n 1)
    die "cannot install packages (${reason:-apt-get failed}); with the network up, run as root: apt-get update && $command"
fi
