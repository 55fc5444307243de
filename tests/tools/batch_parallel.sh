#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# batch_parallel.sh BILAYER FOLDER: GNU parallel runs the shards of a batch, over ssh on the loopback interface.
source "$(dirname "$0")/batch_shared.sh"
need parallel ssh sshd ssh-keygen awk
PATH=$PATH:/usr/sbin
bilayer=$1 work=$2 port=$((20000 + $$ % 20000))
rm -rf "$work" && mkdir -p "$work" && cd "$work"
make_library meshes 24

server=
trap '[[ -z $server ]] || kill "$server" 2>/dev/null || true' EXIT
for key in host user; do ssh-keygen -q -t ed25519 -N '' -f "$key"; done
cat >sshd.conf <<TEXT
ListenAddress 127.0.0.1
Port $port
HostKey $work/host
AuthorizedKeysFile $work/user.pub
StrictModes no
UsePAM no
PermitRootLogin yes
PidFile none
TEXT
[[ -d /run/sshd ]] || mkdir -p /run/sshd 2>/dev/null || { echo "skipped: sshd cannot run here"; exit "$skipped"; }
"$(command -v sshd)" -D -e -f "$work/sshd.conf" 2>sshd.txt &
server=$!
ssh=(ssh -i "$work/user" -p "$port" -o StrictHostKeyChecking=no -o UserKnownHostsFile=/dev/null -o LogLevel=ERROR)
wait_for 5 "${ssh[@]}" 127.0.0.1 true 2>/dev/null || { echo "skipped: no ssh to this machine"; exit "$skipped"; }

HOME=$work parallel --will-cite --ssh "${ssh[*]}" --sshlogin 2/127.0.0.1 \
  "$bilayer batch --tree $work/meshes -o $work/fields --shard {}/4 --threads 1 --resolution 32 >/dev/null" ::: 1 2 3 4
"$bilayer" batch --tree meshes -o direct --resolution 32 >/dev/null
require_same fields direct
(($(ls fields/.bilayer/records | wc -l) == 4)) || { echo "not four shards"; exit 1; }
echo "24 meshes in four shards over ssh, as by one batch"
