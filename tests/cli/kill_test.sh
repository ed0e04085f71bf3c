#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# kill_test.sh PROGRAM SCRATCH: kills training at random moments, again and again, and holds what lies on disk then
# against a run that nobody killed; an earlier model, of another training, lies there first. NERFVDB_KILLS says how
# often (12), NERFVDB_KILL_SEED repeats the moments.
set -euo pipefail
program=$1
scratch=$2
kills=${NERFVDB_KILLS:-12}
seed=${NERFVDB_KILL_SEED:-$((${EPOCHREALTIME/[.,]/} % 32768))}
RANDOM=$seed

rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch"

# fail WORDS...: also says how to repeat it.
fail() {
    printf '%s\n' "FAILED (NERFVDB_KILL_SEED=$seed, kill $n): $*"
    if [[ -f err ]]; then sed 's/^/  err: /' err; fi
    ls -la
    exit 1
}

microseconds() { printf '%s' "${EPOCHREALTIME/[.,]/}"; }

# half_written: a temporary that nobody has finished.
half_written() { compgen -G "model.*-*.part.*" >/dev/null; }

# begin_run: starts training, or goes on with it where there is a checkpoint; its process is $pid.
begin_run() {
    local words=(--steps "$steps")
    if [[ -e model.ckpt ]]; then words=(--resume); fi
    "$program" train data --out model.vdb "${words[@]}" --checkpoint-every 0.001s >out 2>err &
    pid=$!
}

# begin_anew: nothing lies there but the earlier model.
begin_anew() {
    rm -f model.*
    cp earlier.vdb model.vdb
}

# check_files: the model is the earlier one or the new one, and a checkpoint is whole or is not there.
check_files() {
    "$program" info model.vdb >out 2>err || fail "info cannot read the model"
    cmp -s model.vdb earlier.vdb || cmp model.vdb whole.vdb || fail "a model that nobody made"
    if [[ -e model.ckpt ]]; then
        head -c 20 model.ckpt | cmp -s - <(head -c 20 whole.ckpt) || fail "the checkpoint has no head"
    fi
}

n=0
readonly steps=24,12,6
"$program" synth sphere --out data --views 12 --val-views 0 --test-views 3 --width 48 --height 48 --no-truth >out 2>err
begin=$(microseconds)
"$program" train data --out whole.vdb --steps $steps --checkpoint-every 0.001s >out 2>err || fail "training failed"
whole_us=$(($(microseconds) - begin))
"$program" train data --out earlier.vdb --steps 9 --seed 2 >out 2>err || fail "training failed"
begin_anew

while_writing=0
finished=0
resumed=0
while ((n < kills)); do
    if [[ -e model.ckpt ]]; then resumed=$((resumed + 1)); fi
    begin_run
    begin=$(microseconds)
    # Half of the moments are any, half are the first in which a file is being written after that.
    moment=$((whole_us * RANDOM / 32768))
    while (($(microseconds) - begin < moment)) && kill -0 $pid 2>/dev/null; do sleep 0.002; done
    if ((n % 2)); then
        while kill -0 $pid 2>/dev/null && ! half_written; do :; done
    fi
    kill -KILL $pid 2>/dev/null || true
    code=0
    wait $pid 2>/dev/null || code=$?
    if ((code == 0)); then  # it was faster
        cmp model.vdb whole.vdb || fail "a run that was killed and resumed ended with another model"
        finished=$((finished + 1))
        begin_anew
        continue
    fi
    ((code == 137)) || fail "exit code $code: a run could not go on"
    n=$((n + 1))
    if half_written; then while_writing=$((while_writing + 1)); fi
    check_files
done

begin_run
wait $pid || fail "the last run could not go on"
cmp model.vdb whole.vdb || fail "the resumed run ended with another model than the one that nobody killed"
cmp model.ckpt whole.ckpt || fail "the resumed run ended with another checkpoint"
if half_written; then fail "temporaries of killed runs were not cleared"; fi
((resumed > 0)) || fail "no run was resumed: nothing was tested"
printf '%s\n' "survived: $n of $kills kills, $while_writing of them with a file half written; $resumed runs resumed, \
$((finished + 1)) ended, all with the same model; NERFVDB_KILL_SEED=$seed"
