# What the service promises under real systemd (tests/lab_service.rs). Each step holds, or it is named and the script ends.
set -E
step=start
trap 'echo "FAILED at step: $step (line $LINENO)"; systemctl status demeter --no-pager -l | tail -25; journalctl -u demeter --no-pager | tail -40' ERR
begin() { step=$*; echo "step $(cut -d" " -f1 /proc/uptime): $*"; }
of() { systemctl show demeter --property="$1" --value; }
# Bash lets a command that is negated with ! pass whatever comes of it.
refused() { if "$@" 2>&1; then false; fi; }
# Waits up to so many seconds for a command to hold.
within() { local left=$(($1 * 10)); shift; until "$@"; do left=$((left - 1)); [ $left -gt 0 ]; sleep 0.1; done; }
store=/var/lib/demeter/demeter.sqlite
get() { exec 9<>/dev/tcp/127.0.0.1/8420; printf 'GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n' "$1" >&9; cat <&9; exec 9<&-; }
says() { [[ $(get /api/v1/status 2>/dev/null) == *$1* ]]; }
another() { [ "$(of MainPID)" != "$1" ] && [ "$(of MainPID)" != 0 ] && systemctl is-active --quiet demeter; }

begin install
cp -a install/. /
systemd-sysusers
systemd-tmpfiles --create
useradd --create-home --groups demeter agronomist
udevadm control --reload
systemctl daemon-reload
[ -z "$(systemd-analyze verify demeter.service demeter-sync.service demeter-sync.timer 2>&1)" ]
modprobe vivid n_devs=1 node_types=0x1
udevadm settle
ls -l /dev/demeter/
[ "$(stat -c %a:%U:%G /var/lib/demeter)" = 750:demeter:demeter ]
cp /etc/demeter/demeter.toml installed.toml
# The configuration as it is installed, and more.
configure() { cat installed.toml - > /etc/demeter/demeter.toml; }
made_up='[source]
kind = "synthetic"
plants = 3'
configure <<< "$made_up"

begin ready
systemctl start demeter
[ "$(of StatusErrno)" = 0 ]
says '"activity"'
[ "$(ps -o user= -p "$(of MainPID)")" = demeter ]
within 60 says finished

begin records are read by operators and by nobody else
count='select count(*) from plants'
[ "$(su agronomist -c "sqlite3 $store '$count'")" = 3 ]
refused su nobody -s /bin/sh -c "sqlite3 $store '$count'"
refused su agronomist -c "sqlite3 $store 'delete from plants'"
[ "$(stat -c %a:%U:%G $store)" = 640:demeter:demeter ]

begin every directive of the sandbox is in force
install -m 755 probe.sh /usr/local/bin/probe
touch /tmp/of-the-host
probe > control
sed 's|^ExecStart=.*|ExecStart=/usr/local/bin/probe|; s/^Type=notify/Type=oneshot/; /^Restart/d; /^WatchdogSec/d' \
    /usr/lib/systemd/system/demeter.service > /run/systemd/system/probe.service
systemctl daemon-reload
systemctl start probe
journalctl --unit probe --output cat --no-pager | grep -E '^(allowed|denied) ' > sandboxed

begin reload takes a good configuration and refuses a bad one
configure <<< 'no_such_key = 1'
systemctl reload demeter
within 20 says no_such_key
configure <<< "$made_up"
systemctl reload demeter
within 20 says '"reasons":[]'

begin SIGKILL, and it is started again
pid=$(of MainPID)
kill -9 "$pid"
within 30 another "$pid"

begin SIGSTOP, and the watchdog starts it again
mkdir -p /run/systemd/system/demeter.service.d
printf '[Service]\nWatchdogSec=4s\n' > /run/systemd/system/demeter.service.d/sooner.conf
systemctl daemon-reload
systemctl restart demeter
pid=$(of MainPID)
sleep 6
[ "$(of MainPID)" = "$pid" ]
kill -STOP "$pid"
within 40 another "$pid"
journalctl --unit demeter --no-pager | grep -q 'Watchdog timeout'

begin SIGPWR leaves everything in the store itself
pid=$(of MainPID)
systemctl kill --signal PWR demeter
within 30 another "$pid"
systemctl stop demeter
[ "$(of ExecMainStatus)" = 0 ]
[ ! -s $store-wal ]
cp $store stopped.sqlite

begin a full disk makes plants wait, and nothing is lost
mount -t tmpfs -o "size=145m,mode=750,uid=$(id -u demeter),gid=$(id -g demeter)" full /var/lib/demeter
configure <<< "${made_up/3/8}"
# Filled for the most part before, so that the rest is filled before the plants are made.
dd if=/dev/zero of=/var/lib/demeter/most bs=1M count=75 status=none
systemctl start demeter
pid=$(of MainPID)
some() { [ "$(su agronomist -c "sqlite3 $store '$count'")" -gt 0 ]; }
within 60 some
refused dd if=/dev/zero of=/var/lib/demeter/fill bs=1M
within 20 says storage_full
before=$(sqlite3 $store "$count")
rm /var/lib/demeter/fill /var/lib/demeter/most
within 10 says '"full":false'
within 60 says finished
[ "$before" -lt 8 ]
[ "$(sqlite3 $store "$count")" = 8 ]
[ "$(of MainPID)" = "$pid" ]
systemctl stop demeter
umount /var/lib/demeter

begin a newer store: 78 and no restart
failed() { [ "$(of ActiveState)" = failed ] && [ "$(of ExecMainStatus)" = "$1" ]; }
version=$(sqlite3 $store 'pragma user_version')
sqlite3 $store 'pragma user_version = 99'
refused systemctl start demeter
failed 78
sleep 4
failed 78
sqlite3 $store "pragma user_version = $version"

begin a bad configuration: 2 and no restart
systemctl reset-failed demeter
configure <<< 'no_such_key = 1'
refused systemctl start demeter
failed 2
sleep 4
failed 2
configure <<< "$made_up"

begin a secret reaches the service and nobody else
echo very-secret > /etc/credstore/demeter-sync
systemctl start demeter
[ "$(cat /run/credentials/demeter.service/demeter-sync)" = very-secret ]
refused su agronomist -c 'cat /run/credentials/demeter.service/demeter-sync'
refused grep very-secret <(journalctl --no-pager)

begin a camera is unplugged and comes back without a restart
configure <<'TOML'
[source]
kind = "cameras"
speed_m_per_s = 0.5
[[cameras]]
id = "left"
device = "platform:vivid-000"
format = "yuyv"
hfov_deg = 60
height_m = 1.0
TOML
systemctl reload demeter
within 30 says '"state":"streaming"'
pid=$(of MainPID) restarts=$(of NRestarts)
echo vivid.0 > /sys/bus/platform/drivers/vivid/unbind
within 30 says '"state":"lost"'
within 10 says '"health":"broken"'
echo vivid.0 > /sys/bus/platform/drivers/vivid/bind
within 30 says '"state":"streaming"'
[ "$(of MainPID)" = "$pid" ]
[ "$(of NRestarts)" = "$restarts" ]

begin the nightly timer fires, and plants leave
install -d -o demeter -g demeter /var/lib/demeter/depot
sed -i '/^\[sync\]/,/^#*url = /s|^#url = .*|url = "file:///var/lib/demeter/depot"|; s|^#trust_clock = .*|trust_clock = true|' /etc/demeter/demeter.toml
systemctl reload demeter
[ "$(systemctl show demeter-sync.timer --property=Persistent --value)" = yes ]
mkdir -p /run/systemd/system/demeter-sync.timer.d
printf '[Timer]\nOnCalendar=\nOnActiveSec=1s\nRandomizedDelaySec=0\n' > /run/systemd/system/demeter-sync.timer.d/now.conf
systemctl daemon-reload
ran() { [ "$(systemctl show demeter-sync.service --property=ExecMainExitTimestampMonotonic --value)" != 0 ]; }
refused ran
systemctl start demeter-sync.timer
within 60 ran
[ "$(systemctl show demeter-sync.service --property=ExecMainStatus --value)" = 0 ]
[ -n "$(find /var/lib/demeter/depot -name '*.parquet')" ]

begin done
