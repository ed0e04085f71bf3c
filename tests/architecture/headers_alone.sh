#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# headers_alone.sh ROOT COMPILER FLAG...: every header compiles by itself, so that includes may stand in any order.
set -euo pipefail
cd "$1"
shift
find core vdb trainer export bench cli -name '*.h' | sort |
    xargs --max-procs "$(nproc)" --replace=HEADER \
        sh -c 'printf "#include \"HEADER\"\n" | "$@" -std=c++20 -I . -fsyntax-only -x c++ -' sh "$@"
