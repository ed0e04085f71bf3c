#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# headers_alone.sh ROOT COMPILER FLAG...: every header compiles by itself, so that includes may stand in any order.
# Whatever x.cpp includes x.h before all else has shown it for x.h, by being built.
set -euo pipefail
cd "$1"
shift

is_first_in_its_source() {  # HEADER
    local source=${1%.h}.cpp
    [[ -f $source && "$(grep --max-count=1 '^ *#' "$source")" == "#include \"$1\"" ]]
}

find core vdb trainer export bench cli -name '*.h' | sort |
    while read -r header; do is_first_in_its_source "$header" || printf '%s\n' "$header"; done |
    xargs --max-procs "$(nproc)" --replace=HEADER \
        sh -c 'printf "#include \"HEADER\"\n" | "$@" -std=c++20 -I . -fsyntax-only -x c++ -' sh "$@"
