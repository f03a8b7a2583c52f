#!/bin/sh
# can.sh COMMAND [ARGUMENT...]   run COMMAND where SocketCAN is, with vcan0 and vcan1 up; its exit status is returned.
#
#   RIG=native|uml|qemu   one of them only; otherwise the first that works:
#     native   this kernel has CAN (as root, or in a user and network namespace of its own)
#     uml      User-Mode Linux: a kernel as a process, with this machine's files as its root.     user-mode-linux kmod iproute2
#              4 s to start; every system call costs 20 to 60 us there.
#     qemu     Debian's kernel in an emulator that counts instructions: 20 s to start; time is     qemu-system-x86 busybox-static
#              virtual, so no load of the machine can make a timer late.                           cpio kmod linux-image-amd64
#   RIG_TIMEOUT=SECONDS   120, qemu 600
#
# Exit status 98: nothing of this can be had here, and a line says so; 99: the guest died or took too long. The command
# runs as root in a guest, and what it writes below this machine's root is written there. vcan has neither a bit rate nor arbitration nor
# error frames: what a bus would carry is computed from the frames, not measured here.
set -u
PATH=$PATH:/usr/sbin:/sbin
export PATH
self=$(readlink -f "$0")

die()
{
    echo "can.sh: $*" >&2
    exit 98
}

interfaces()
{
    for i in vcan0 vcan1; do
        ip link show "$i" >/dev/null 2>&1 || ip link add dev "$i" type vcan 2>/dev/null || return 1
        ip link set "$i" up 2>/dev/null || return 1
    done
}

have_can()
{
    python3 -c 'import socket; socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)' 2>/dev/null
}

# ---- in the guest: the first process of User-Mode Linux, or what QEMU's initrd hands over to ----

guest()
{
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    HOME=/root
    export PATH HOME
    [ -e /proc/self ] || mount -t proc proc /proc
    [ -e /sys/class ] || mount -t sysfs sys /sys
    mkdir -p /dev/pts /dev/shm
    mount -t devpts devpts /dev/pts
    mount -t tmpfs tmpfs /dev/shm
    mount -t tmpfs tmpfs /run
    if ! have_can; then # by path, in the order of their dependence: there is no modules.dep for User-Mode Linux
        modules=/usr/lib/uml/modules/$(uname -r)/kernel
        for m in net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw drivers/net/can/dev/can-dev \
            drivers/net/can/vcan drivers/net/can/vxcan drivers/net/can/slcan/slcan; do
            insmod "$modules/$m.ko"
        done
    fi
    echo 16777216 >/proc/sys/net/core/rmem_max
    ip link set lo up
    interfaces
    sh "$RIG_DIR/command" >"$RIG_DIR/out" 2>&1 </dev/null
    echo $? >"$RIG_DIR/status.new"
    mv "$RIG_DIR/status.new" "$RIG_DIR/status"
    sync
    # power off: a first process has nobody to tell it to
    exec python3 -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321fedc)'
}

[ "${1-}" = --guest ] && guest
[ $$ -eq 1 ] && [ -n "${RIG_DIR-}" ] && [ $# -eq 0 ] && guest
[ $# -gt 0 ] || {
    echo "usage: can.sh COMMAND [ARGUMENT...]" >&2
    exit 2
}

# ---- here ----

prepare()
{
    RIG_DIR=$(mktemp -d "${TMPDIR:-/tmp}/can.XXXXXX") || die "no temporary directory can be made"
    trap 'rm -rf "$RIG_DIR"' EXIT
    trap 'exit 130' INT TERM
    {
        echo "cd '$PWD'"
        export -p | grep -vE ' (PATH|HOME|PWD|OLDPWD|SHLVL|_|TERM)(=|$)'
        printf 'exec'
        for word; do printf " '%s'" "$(printf %s "$word" | sed "s/'/'\\\\''/g")"; done
        echo
    } >"$RIG_DIR/command"
}

finish()
{
    [ -f "$RIG_DIR/out" ] && cat "$RIG_DIR/out"
    if [ -s "$RIG_DIR/status" ]; then
        exit "$(cat "$RIG_DIR/status")"
    fi
    echo "can.sh: the guest died, or took longer than its time" >&2
    tail -n 20 "$RIG_DIR/console" >&2
    exit 99
}

native_works()
{
    have_can && { interfaces || unshare -rn true 2>/dev/null; }
}

run_native()
{
    interfaces && exec "$@"
    exec unshare -rn sh -c 'ip link set lo up
        for i in vcan0 vcan1; do ip link add "$i" type vcan && ip link set "$i" up || exit 98; done
        exec "$@"' sh "$@"
}

uml_works()
{
    command -v linux.uml >/dev/null && command -v insmod >/dev/null && command -v ip >/dev/null &&
        ls /usr/lib/uml/modules/*/kernel/net/can/can-raw.ko >/dev/null 2>&1
}

run_uml()
{
    prepare "$@"
    # its memory is a file that it maps executable, which a container's /dev/shm may forbid
    memory=/dev/shm
    case $(awk '$2 == "/dev/shm" {print $4}' /proc/mounts | tail -n 1) in
    *noexec*) memory=${TMPDIR:-/tmp} ;;
    esac
    TMPDIR=$memory timeout -k 5 "${RIG_TIMEOUT:-120}" linux.uml rootfstype=hostfs rootflags=/ rw mem=256M quiet \
        uml_dir="$RIG_DIR/" init="$self" RIG_DIR="$RIG_DIR" con=null con0=null,fd:1 ssl=null \
        </dev/null >"$RIG_DIR/console" 2>&1
    finish
}

kernel()
{
    ls -t "${RIG_KERNEL_ROOT-}"/boot/vmlinuz-*-amd64 2>/dev/null | grep -v cloud | head -n 1
}

qemu_works()
{
    command -v qemu-system-x86_64 >/dev/null && command -v busybox >/dev/null && command -v cpio >/dev/null &&
        command -v depmod >/dev/null && [ -n "$(kernel)" ]
}

# Modules that mount this machine's root over 9p, and those of CAN, in an initrd that switches to it.
make_initrd()
{
    version=${1##*/vmlinuz-}
    root=${RIG_KERNEL_ROOT:-/}
    tree=$(mktemp -d) || die "no temporary directory can be made"
    mkdir -p "$tree/bin" "$tree/m" "$tree/proc" "$tree/sys" "$tree/dev" "$tree/host"
    cp "$(command -v busybox)" "$tree/bin/busybox"
    [ -e "$root/lib/modules/$version/modules.dep.bin" ] || depmod -b "$root" "$version"
    n=100
    for m in virtio_pci 9pnet_virtio 9p can_raw can_bcm can_gw can_isotp can_dev vcan vxcan slcan; do
        for file in $(modprobe -d "$root" -S "$version" --show-depends "$m" 2>/dev/null |
            awk '$1 == "insmod" {print $2}'); do
            ls "$tree/m" | grep -q -- "-${file##*/}\$" && continue
            n=$((n + 1))
            cp "$file" "$tree/m/$n-${file##*/}"
        done
    done
    cat >"$tree/init" <<'INIT'
#!/bin/busybox sh
B=/bin/busybox
$B mount -t proc p /proc
$B mount -t sysfs s /sys
$B mount -t devtmpfs d /dev
for m in /m/*.ko; do $B insmod $m; done
for a in $($B cat /proc/cmdline); do case $a in RIG_DIR=* | RIG_INIT=*) export "$a" ;; esac done
$B mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose hostroot /host
for d in dev sys proc; do $B mount --move /$d /host/$d; done
exec $B switch_root /host "$RIG_INIT" --guest
INIT
    chmod +x "$tree/init"
    (cd "$tree" && find . | cpio -o -H newc --quiet | gzip -1) >"$RIG_DIR/initrd"
    rm -rf "$tree"
}

run_qemu()
{
    prepare "$@"
    make_initrd "$(kernel)"
    # time is instructions executed, and idle time is skipped
    timeout -k 5 "${RIG_TIMEOUT:-600}" qemu-system-x86_64 -accel tcg -cpu max -icount shift=0,sleep=off -m 512 -smp 1 \
        -nodefaults -no-user-config -display none -no-reboot -serial file:"$RIG_DIR/console" \
        -kernel "$(kernel)" -initrd "$RIG_DIR/initrd" \
        -append "console=ttyS0 quiet panic=-1 mitigations=off nokaslr tsc=reliable RIG_DIR=$RIG_DIR RIG_INIT=$self" \
        -fsdev local,id=r,path=/,security_model=none,multidevs=remap \
        -device virtio-9p-pci,fsdev=r,mount_tag=hostroot </dev/null >"$RIG_DIR/qemu.log" 2>&1
    [ -s "$RIG_DIR/status" ] || cat "$RIG_DIR/qemu.log" >&2
    finish
}

case ${RIG-} in
native)
    native_works || die "this kernel has no SocketCAN, or makes no vcan interface for this user"
    run_native "$@"
    ;;
uml)
    uml_works || die "User-Mode Linux is not here: apt-get install user-mode-linux kmod iproute2"
    run_uml "$@"
    ;;
qemu)
    qemu_works || die "QEMU is not here: apt-get install qemu-system-x86 busybox-static cpio kmod linux-image-amd64"
    run_qemu "$@"
    ;;
'')
    if native_works; then run_native "$@"; fi
    if uml_works; then run_uml "$@"; fi
    if qemu_works; then run_qemu "$@"; fi
    die "SocketCAN was not exercised: this kernel has none, and there is no rig; apt-get install user-mode-linux kmod iproute2"
    ;;
*)
    die "there is no rig '$RIG'; native, uml and qemu are"
    ;;
esac
