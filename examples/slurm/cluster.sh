#!/usr/bin/env bash
# A Slurm of this machine alone, to try the example where there is none: one controller and several
# slurmd, each a node of one processor. As root; all of its files are in FOLDER.
#
#   bash cluster.sh start FOLDER [NODES] [FIRST_PORT]    then: export SLURM_CONF=FOLDER/slurm.conf
#   bash cluster.sh kill FOLDER NODE                     a node and what runs on it, as by a power cut
#   bash cluster.sh revive FOLDER NODE
#   bash cluster.sh stop FOLDER
set -euo pipefail

die() { printf 'cluster.sh: %s\n' "$*" >&2; exit 1; }

[ $# -ge 2 ] || die "start, kill, revive or stop, and a folder"
command=$1 folder=$(realpath -m "$2")

start() {
    local nodes=${1:-4} port=${2:-26817} host
    [ "$(id -u)" -eq 0 ] || die "needs root"
    host=$(hostname -s)
    mkdir -p "$folder"/{state,spool,log}
    chmod 700 "$folder"
    # munged wants folders that no other user can write.
    dd if=/dev/urandom of="$folder/munge.key" bs=128 count=1 status=none
    chmod 400 "$folder/munge.key"
    munged --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
        --pid-file="$folder/munged.pid" --log-file="$folder/log/munged.log" --seed-file="$folder/munge.seed"
    cat >"$folder/slurm.conf" <<CONF
ClusterName=volley
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
AuthType=auth/munge
# Jobs of a lost node go back to the queue once their credentials have expired.
AuthInfo=socket=$folder/munge.socket,cred_expire=10
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.%n.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
ReturnToService=2
JobRequeue=1
SlurmdTimeout=15
KillWait=30
# Jobs of the partition "urgent" take the nodes of others, which get SIGTERM, some seconds, and go back. On
# clusters that send no signal a job is killed at once and goes back as well.
SlurmctldParameters=preempt_send_user_signal
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
NodeName=n[1-$nodes] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$((port + 1))-$((port + nodes))] CPUs=1
PartitionName=render Nodes=ALL Default=YES MaxTime=INFINITE State=UP PriorityTier=1 GraceTime=20
PartitionName=urgent Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=2 PreemptMode=OFF
CONF
    export SLURM_CONF=$folder/slurm.conf
    slurmctld -c
    local node
    for node in $(seq "$nodes"); do
        mkdir -p "$folder/spool/n$node"
        slurmd -N "n$node"
    done
    for _ in $(seq 100); do
        [ "$(sinfo -h -N -p render -t idle -o %N 2>/dev/null | wc -l)" -eq "$nodes" ] && return
        sleep 0.3
    done
    sinfo -N >&2 || true
    die "the nodes are not up; logs: $folder/log"
}

# A process and all that it started, by their ids.
kill_tree() {
    local child
    for child in $(ps -o pid= --ppid "$1"); do
        kill_tree "$child"
    done
    kill -KILL "$1" 2>/dev/null || true
}

# Whether a process was started with NAME=VALUE.
has_variable() { { tr '\0' '\n' <"/proc/$1/environ" | grep -qx "$2"; } 2>/dev/null; }

# Whether a slurmstepd has a task of a node.
runs_on() {
    local task
    for task in $(ps -o pid= --ppid "$1"); do
        has_variable "$task" "SLURMD_NODENAME=$2" && return 0
    done
    return 1
}

kill_node() {
    local pid
    # They have let go of their slurmd; what they started knows the node.
    for pid in $(pgrep -x slurmstepd); do
        has_variable "$pid" "SLURM_CONF=$folder/slurm.conf" && runs_on "$pid" "$1" && kill_tree "$pid"
    done
    kill -KILL "$(cat "$folder/slurmd.$1.pid")" 2>/dev/null || true
}

stop() {
    local file
    export SLURM_CONF=$folder/slurm.conf
    scancel --partition=render,urgent 2>/dev/null || true
    for file in "$folder"/slurmd.*.pid "$folder/slurmctld.pid" "$folder/munged.pid"; do
        [ -s "$file" ] && kill "$(cat "$file")" 2>/dev/null || true
    done
}

case $command in
start) shift 2; start "$@" ;;
kill) kill_node "$3" ;;
revive) SLURM_CONF=$folder/slurm.conf slurmd -N "$3" ;;
stop) stop ;;
*) die "unknown: $command" ;;
esac
