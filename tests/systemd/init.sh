#!/bin/sh
# The first process of user-mode Linux, started by tests/vcan/lab with LAB_INIT: makes a machine of its own of the host's
# files, none of which it can change, and becomes systemd there. The job is a service of it.
PATH=/usr/sbin:/usr/bin:/sbin:/bin

say() {
    echo "init: $*" >/dev/console
}

mount -t proc proc /proc || say "no /proc"
mount -o remount,ro / || { say "the host's files cannot be made read-only"; exit 1; }
mount -t tmpfs tmpfs /run || say "no /run"
mount -t tmpfs tmpfs /mnt || say "no /mnt"

mkdir -p /run/modules/lib
ln -s /usr/lib/uml/modules /run/modules/lib/modules
for module in overlay can can-raw can-dev vcan; do
    modprobe -d /run/modules "$module" || say "no module $module"
done

# What is written goes to memory, over the host's files.
mkdir /mnt/written /mnt/work /mnt/root
mount -t overlay overlay -o lowerdir=/,upperdir=/mnt/written,workdir=/mnt/work /mnt/root || say "no overlay"
cd /mnt/root || say "no root"

# No service of the host, no file system of it to mount, nothing to bring up to date: a machine that was just installed.
rm -rf etc/systemd/system etc/systemd/network etc/fstab etc/modules-load.d etc/rc.local
mkdir -p etc/systemd/system "usr/lib/modules"
ln -sfn "/usr/lib/uml/modules/$(uname -r)" "usr/lib/modules/$(uname -r)"
touch etc/.updated var/.updated
[ -s etc/machine-id ] || echo 0123456789abcdef0123456789abcdef >etc/machine-id
# Nor anything of taxeld's that lies about on the host: machine.py checks it.
rm -rf etc/taxeld etc/default/taxeld var/lib/taxeld var/lib/private/taxeld usr/bin/taxel* usr/local/bin/taxel*
rm -f usr/lib/systemd/system/taxel* lib/systemd/system/taxel* etc/udev/rules.d/*taxel* usr/lib/udev/rules.d/*taxel*
sed -i '/^skin:/d' etc/group etc/gshadow
# What an image of a container keeps dpkg from: pages of the manual, and starting what it installs.
rm -f .dockerenv usr/sbin/policy-rc.d etc/dpkg/dpkg.cfg.d/*
# An index of all the host's pages would take longer than all else.
rm -f var/lib/man-db/auto-update
for unit in dbus.socket dbus.service systemd-logind.service systemd-update-utmp.service getty.target remote-fs.target; do
    ln -s /dev/null "etc/systemd/system/$unit"
done

cat >etc/systemd/system/lab.target <<UNIT
[Unit]
Requires=multi-user.target lab.service
After=multi-user.target
AllowIsolate=yes
UNIT

cat >etc/systemd/system/multi-user.target <<UNIT
[Unit]
Requires=basic.target
After=basic.target
AllowIsolate=yes
UNIT

cat >etc/systemd/system/lab.service <<UNIT
[Service]
Type=oneshot
TimeoutStartSec=infinity
ExecStart=/bin/bash -c '. \$0/environment; . \$0/command' $LAB_SCRATCH
ExecStopPost=/bin/sh -c 'echo "\$EXIT_STATUS" >"\$0/exit"; sync; systemctl poweroff -ff' $LAB_SCRATCH
StandardOutput=append:$LAB_SCRATCH/output
StandardError=inherit
UNIT

# An empty /tmp, and in it the one place where the host sees what comes of it.
mount -t tmpfs tmpfs tmp || say "no /tmp"
mkdir -p ".$LAB_SCRATCH"
mount -t hostfs none ".$LAB_SCRATCH" -o "$LAB_SCRATCH" || say "no $LAB_SCRATCH"

mkdir -p host
umount /proc
pivot_root . host
exec chroot . /usr/lib/systemd/systemd --unit=lab.target --show-status=no
