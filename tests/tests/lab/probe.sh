#!/bin/bash
# Tries what the sandbox of demeter.service forbids, as root or as the service, and says for each what came of it:
# `allowed NAME` or `denied NAME`. What the service needs is tried the same way, with names that begin with `needed`.
try() {
    local name=$1
    shift
    if "$@" >/dev/null 2>&1; then echo "allowed $name"; else echo "denied $name"; fi
}
# A system call by its number, where no tool makes it: perl gives -1 for one that failed.
call() { perl -e 'my @a = map { $_ + 0 } @ARGV; exit(syscall(shift(@a), @a) == -1 ? 1 : 0)' "$@"; }
opened() { (exec 3<"$1"); }
written() { (exec 3>>"$1"); }

try capabilities grep -qE '^CapBnd:.*[1-9a-f]' /proc/self/status
try new_privileges grep -q '^NoNewPrivs:.*0' /proc/self/status
try system_files touch /usr/probe
try configuration touch /etc/demeter/probe
try homes ls /root /home/agronomist
try clock date -s now
try cgroups mkdir /sys/fs/cgroup/probe
try hostname hostname probe
try kernel_log dmesg
try modules modprobe dummy
try tunables written /proc/sys/kernel/printk
try processes test -e /proc/1/status
try temporary_files test -e /tmp/of-the-host
try personality setarch -R true
# mmap of a page that may be written and executed.
try write_execute call 9 0 4096 7 34 0 0
try packet_sockets call 41 17 3 0
try namespaces unshare --uts true
try realtime chrt -f 1 true
try setuid_files bash -c 't=$(mktemp) && chmod u+s $t'
# ptrace's PTRACE_TRACEME needs no privilege, so only the filter of system calls is in its way.
try debugging call 101 0 0 0 0
try disks opened /dev/ubda
try memory opened /dev/mem
try needed_state touch "/var/lib/demeter/probe-of-$(id -un)"
try needed_random opened /dev/urandom
try needed_camera opened /dev/video0
try needed_serial opened /dev/ttyS0
try needed_loopback call 41 2 1 0
