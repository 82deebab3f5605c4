#!/bin/sh
# The first and only process of user-mode Linux, started by `lab`: makes a CAN bus, runs the job, halts.
# The root file system is the host's, and writable: nothing here may write outside of the mounts made here and of the
# scratch directory.
PATH=/usr/sbin:/usr/bin:/sbin:/bin

say() {
    echo "init: $*" >/dev/console
}

end() {
    sync
    halt -f || echo o >/proc/sysrq-trigger
    # Only if neither works: the first process must not return, or the kernel says it panics.
    sleep 10
}

mount -t proc proc /proc || say "no /proc"
mount -t sysfs sysfs /sys || say "no /sys"
# The kernel has mounted /dev itself.
mkdir -p /dev/pts /dev/shm
mount -t devpts devpts /dev/pts || say "no /dev/pts"
mount -t tmpfs tmpfs /dev/shm || say "no /dev/shm"

# Empty /tmp and /run, with holes for what the job needs of the host's.
expose=$(cat "$LAB_SCRATCH/expose")
mount -t tmpfs tmpfs /tmp || say "no /tmp"
mount -t tmpfs tmpfs /run || say "no /run"
echo "$expose" | sort -u | while IFS= read -r path; do
    case $path in
    # A directory that is there already lies in one mounted before: the list is sorted.
    /tmp/* | /run/*) [ -d "$path" ] || { mkdir -p "$path" && mount -t hostfs none "$path" -o "$path"; } || say "no $path" ;;
    esac
done

# The kernel loads what it needs by itself, from where the package has its modules.
mkdir -p /run/modules/lib
ln -s /usr/lib/uml/modules /run/modules/lib/modules
printf '#!/bin/sh\nexec modprobe -d /run/modules "$@"\n' >/run/modprobe
chmod +x /run/modprobe
echo /run/modprobe >/proc/sys/kernel/modprobe
for module in can can-raw can-dev vcan; do
    /run/modprobe "$module" || say "no module $module"
done

ip link set lo up || say "no loopback"
ip link add dev vcan0 type vcan && ip link set vcan0 up || say "no vcan0"

bash -c '. "$0/environment"; . "$0/command"' "$LAB_SCRATCH" </dev/null >>"$LAB_SCRATCH/output" 2>&1
code=$?
sync
echo "$code" >"$LAB_SCRATCH/exit"
end
