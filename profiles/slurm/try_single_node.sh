#!/usr/bin/env bash
# Starts a SLURM of one node on this machine and runs the sample campaign through it: the test of profiles/slurm.
#
#     sudo env "PATH=$PATH" profiles/slurm/try_single_node.sh [snakemake arguments]
#
# Debian or Ubuntu, as root; installs slurmctld, slurmd, slurm-client and munge where they are missing. All state is in
# a temporary folder, but for a link /etc/slurm/slurm.conf (jobs lose the variable SLURM_CONF); daemons and link end with
# the script.
set -euo pipefail

if [ -e /etc/slurm/slurm.conf ]; then
    echo "/etc/slurm/slurm.conf exists: this machine has a SLURM; run snakemake --profile profiles/slurm" >&2
    exit 1
fi

if ! command -v snakemake > /dev/null; then
    echo "snakemake is not on the path: activate the environment with towval[slurm], and keep PATH as in the line above" >&2
    exit 1
fi
# To the end: a reader that left early would fail the pipe.
if ! snakemake --help | grep "executor {.*slurm" > /dev/null; then
    echo "this snakemake has no executor slurm: pip install 'towval[slurm]' into its environment" >&2
    exit 1
fi

repository=$(cd "$(dirname "$0")/../.." && pwd)
if ! command -v slurmctld slurmd munged > /dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge
fi

state=$(mktemp -d)
started=()
cleanup() {
    for pid in "${started[@]}"; do kill "$pid" 2> /dev/null || true; done
    wait 2> /dev/null || true
    rm -rf /etc/slurm/slurm.conf "$state"
}
trap cleanup EXIT

mkdir -p "$state"/{controller,node,munge}
dd if=/dev/urandom bs=1 count=1024 status=none > "$state/munge/key"
chmod 0400 "$state/munge/key"
chmod 0711 "$state"
chmod 0755 "$state/munge"
munged --foreground --force --key-file="$state/munge/key" --socket="$state/munge/socket" \
    --pid-file="$state/munge/pid" --log-file="$state/munge/log" --seed-file="$state/munge/seed" 2> /dev/null &
started+=($!)

host=$(hostname -s)
cat > "$state/slurm.conf" << EOF
ClusterName=single
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$state/munge/socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MailProg=/bin/true
ReturnToService=2
StateSaveLocation=$state/controller
SlurmdSpoolDir=$state/node
SlurmctldPidFile=$state/slurmctld.pid
SlurmdPidFile=$state/slurmd.pid
SlurmctldLogFile=$state/slurmctld.log
SlurmdLogFile=$state/slurmd.log
$(slurmd -C | grep '^NodeName' | sed 's/NodeName=[^ ]*/&\ NodeAddr=127.0.0.1/') State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
mkdir -p /etc/slurm
ln -s "$state/slurm.conf" /etc/slurm/slurm.conf
for _ in $(seq 50); do [ -S "$state/munge/socket" ] && break; sleep 0.1; done
slurmctld -D 2> /dev/null &
started+=($!)
slurmd -D 2> /dev/null &
started+=($!)
for _ in $(seq 60); do sinfo --noheader --states=idle 2> /dev/null | grep -q idle && break; sleep 1; done
sinfo

cd "$repository"
if ! snakemake --profile profiles/slurm --jobs 2 "$@"; then
    tail -n 20 "$state"/*.log >&2
    exit 1
fi
