#!/bin/sh
# fresh.sh CHECKOUT COMMAND...   what a newcomer's machine does: run COMMAND as root in a clean clone of CHECKOUT, inside a
# bare Debian 12 that holds nothing but the minimal base, ca-certificates, git and make. Returns the command's status.
#
# Needs root, debootstrap and this machine's own Debian source. The base is made once (about a minute) and kept in
# FRESH_BASE; each run works on a copy, which is removed. FRESH_KEEP=1 leaves the copy and prints where it is.
# A sibling folder shared/data of CHECKOUT is copied beside the clone, for the tests that read it.
set -eu

die()
{
    echo "fresh: $*" >&2
    exit 1
}

[ $# -ge 2 ] || { echo "usage: fresh.sh CHECKOUT COMMAND..." >&2; exit 2; }
[ "$(id -u)" -eq 0 ] || die "needs root, for chroot and mount"
command -v debootstrap >/dev/null || die "debootstrap is not installed; run: apt-get install -y debootstrap"
checkout=$(cd "$1" && git rev-parse --show-toplevel)
shift

scratch=${TMPDIR:-/tmp}
base=${FRESH_BASE:-$scratch/fresh-debian-12}
source=$(cat /etc/apt/sources.list /etc/apt/sources.list.d/*.list /etc/apt/sources.list.d/*.sources 2>/dev/null |
    awk '/^URIs:/ {print $2; exit} $1 == "deb" {for (i = 2; i <= NF; i++) if ($i ~ "://") {print $i; exit}}')

if [ ! -e "$base/complete" ]; then
    rm -rf --one-file-system "$base"
    echo "fresh: making the base in $base" >&2
    debootstrap --variant=minbase --include=ca-certificates,git,make bookworm "$base" ${source:+"$source"} \
        >"$scratch/fresh-debootstrap.log" 2>&1 || die "debootstrap failed; see $scratch/fresh-debootstrap.log"
    rm -rf "$base"/var/cache/apt/archives/*.deb
    : >"$base/complete"
fi

root=$(mktemp -d "$scratch/fresh.XXXXXX")
leave()
{
    for place in dev proc; do
        mountpoint -q "$root/$place" && umount -l "$root/$place"
    done
    if [ "${FRESH_KEEP-}" ]; then
        echo "fresh: kept $root" >&2
    else
        rm -rf --one-file-system "$root"
    fi
}
trap leave EXIT
trap 'exit 130' INT TERM HUP PIPE

cp -a "$base/." "$root/"
cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
# How this machine reaches its Debian source: a proxy, if one is set.
for file in /etc/apt/apt.conf /etc/apt/apt.conf.d/*; do
    if [ -f "$file" ] && grep -qi 'acquire::.*proxy' "$file"; then
        cp "$file" "$root/etc/apt/apt.conf.d/"
    fi
done
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
if [ -d /dev/pts ]; then mount --bind /dev/pts "$root/dev/pts"; fi
git clone -q "$checkout" "$root/clean/project"
if [ -d "$checkout/../shared/data" ]; then
    mkdir -p "$root/clean/shared"
    cp -a "$checkout/../shared/data" "$root/clean/shared/"
fi
before=$(du -sxm "$root" | cut -f1)
begin=$(date +%s)
status=0
chroot "$root" /usr/bin/env -i HOME=/tmp PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
    TERM=dumb ${CI+CI="$CI"} ${http_proxy+http_proxy="$http_proxy"} ${https_proxy+https_proxy="$https_proxy"} \
    sh -c 'cd /clean/project && exec "$@"' sh "$@" </dev/null || status=$?
echo "fresh: status $status after $(($(date +%s) - begin)) s, $(($(du -sxm "$root" | cut -f1) - before)) MiB more on the disk" >&2
exit $status
