#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# out_of_memory_test.sh PROGRAM SCRATCH: commands in address spaces of every size, from too small to begin to large
# enough: each ends well or says a sentence with exit code 1, and what was there before stays.
set -euo pipefail
program=$1
scratch=$2
limits=${NERFVDB_MEMORY_LIMITS:-4}  # tried per command

rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch"

fail() {
    printf '%s\n' "FAILED: $*"
    if [[ -f err ]]; then tail -n 5 err | sed 's/^/  err: /'; fi
    exit 1
}

if grep -qE '__(asan|tsan)_init' "$program"; then
    printf '%s\n' "a sanitizer needs more address space than there is memory: skipped"
    exit 77
fi

# within KILOBYTES ARGUMENT...: runs the program in that much address space.
within() (
    ulimit -v "$1"
    shift
    exec "$program" "$@" >out 2>err
)

# needs ARGUMENT...: the least address space, to one part in 20, in which the program does this, in kilobytes.
needs() {
    local low=1000 high=$((4 << 20)) middle
    while ((high - low > high / 20)); do
        middle=$(((low + high) / 2))
        if within $middle "$@" 2>/dev/null; then high=$middle; else low=$middle; fi
    done
    printf '%s' $high
}

tried=0
refused=0
# squeeze NAME OUTPUT ARGUMENT...: runs a command between the least that it can begin in and all that it needs.
squeeze() {
    local name=$1 output=$2 enough i limit code n_refused=0
    shift 2
    enough=$(needs "$@")
    rm -rf "$output"
    for ((i = 0; i <= limits; ++i)); do
        limit=$((least + (enough * 21 / 20 - least) * i / limits))
        code=0
        printf 'earlier\n' >"$output"
        within $limit "$@" || code=$?
        tried=$((tried + 1))
        if ((code == 0)); then
            ! cmp -s "$output" <(printf 'earlier\n') || fail "$name in $limit KiB wrote nothing"
        else
            ((code == 1)) || fail "$name in $limit KiB: exit code $code"
            grep -q '^nerfvdb: .' err || fail "$name in $limit KiB: no sentence"
            cmp -s "$output" <(printf 'earlier\n') || fail "$name in $limit KiB changed its output"
            n_refused=$((n_refused + 1))
        fi
        [[ -z "$(find . -name '*.part.*')" ]] || fail "$name in $limit KiB left a temporary"
    done
    ((n_refused > 0)) || fail "$name was never short of memory: nothing was tested"
    refused=$((refused + n_refused))
    printf '%s\n' "$name: needs $((enough / 1024)) MiB of addresses, $n_refused of $((limits + 1)) runs refused"
}

"$program" synth sphere --out data --views 12 --val-views 0 --test-views 3 --width 100 --height 100 --no-truth >out 2>err
"$program" train data --out scene.vdb --steps 20,20 >out 2>err || fail "training failed"
least=$(needs --version)
squeeze train model.vdb train data --out model.vdb --steps 20,20 --checkpoint-every 0.001s
squeeze eval scores.json eval scene.vdb data --json scores.json
squeeze export volume.vdb export scene.vdb --out volume.vdb --fit 0
squeeze mesh mesh.ply mesh scene.vdb --out mesh.ply
squeeze render views.json render scene.vdb --orbit 1 --width 200 --height 200 --out views --json views.json
printf '%s\n' "survived: $tried of $tried runs in too little memory, $refused of them refused with a sentence"
