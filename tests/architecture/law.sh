#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# law.sh ROOT: the law of the house, held against every source file below ROOT.
#   1. Folders include only what lies below them.
#   2. Each third-party library stays behind its fence.
#   3. The library never prints and never exits.
#   4. Each file names its licence.
# Prints each breach as FILE:LINE: TEXT with the rule it breaks, and exits 1 if there is one.
set -euo pipefail
cd "$1"

breaches=0

# report RULE: reads breaches as lines from standard input.
report() {
    local line
    while IFS= read -r line; do
        printf '%s\n    %s\n' "$line" "$1"
        breaches=$((breaches + 1))
    done
}

sources() {  # FOLDER...: C++ files, sorted
    local folder
    for folder in "$@"; do
        if [[ -d $folder ]]; then find "$folder" -name '*.h' -o -name '*.cpp' -o -name '*.inl'; fi
    done | sort
}

# search PATTERN FOLDER...: lines that match, as FILE:LINE: TEXT; // comments are no code.
search() {
    local pattern=$1
    shift
    sources "$@" | while IFS= read -r file; do
        sed 's|//.*||' "$file" | grep -nE -- "$pattern" | sed "s|^|$file:|" || true
    done
}

# --- 1. include direction -------------------------------------------------------------------------------------

# may_include FOLDER ALLOWED...: no quoted include outside the allowed folders.
may_include() {
    local folder=$1 allowed
    allowed=$(IFS='|'; printf '%s' "$*")
    report "$folder/ may include only: $*" < <(
        search '^[[:space:]]*#[[:space:]]*include[[:space:]]*"' "$folder" | grep -vE "\"($allowed)/" || true)
}

may_include core core
may_include vdb vdb core
may_include trainer trainer vdb core
may_include export export vdb core
may_include bench bench export trainer vdb core
may_include cli cli bench export trainer vdb core

# --- 2. fences ------------------------------------------------------------------------------------------------

# fence LIBRARY HEADER_PATTERN FILE_PATTERN: angle includes of a library only in files that match.
fence() {
    local name=$1 header=$2 files=$3
    report "$name only in: $files" < <(
        search "^[[:space:]]*#[[:space:]]*include[[:space:]]*<($header)" core vdb trainer export bench cli |
            grep -vE "^($files):" || true)
}

fence OpenVDB 'openvdb/' '(vdb|export)/[a-z0-9_]+\.cpp|vdb/openvdb_grids\.h|bench/openvdb_peer\.cpp'
fence "OpenVDB's grids" 'openvdb/openvdb\.h' 'vdb/openvdb_grids\.h'
fence OpenImageIO 'OpenImageIO/' 'core/image\.cpp'
fence Highway 'hwy/' 'core/simd/.*'
fence TBB '(tbb|oneapi)/' 'core/parallel\.h'
fence JSON 'nlohmann/' 'trainer/[a-z0-9_]+\.(cpp|h)|export/camera_export\.cpp|bench/result\.cpp|cli/.*'
fence CLI11 'CLI/' 'cli/.*'
fence meshoptimizer 'meshoptimizer' 'export/mesh_simplify\.cpp'
fence tinygltf 'tiny_gltf' 'export/gltf_file\.cpp'
fence VTK 'vtk' 'bench/flying_edges_peer\.cpp'
fence xxHash 'xxhash' 'core/atomic_file\.cpp'

# --- 3. no printing, no exit ----------------------------------------------------------------------------------

report "the library speaks through Report and throws Error" < <(
    search '(^|[^A-Za-z0-9_.>])(printf|fprintf|puts|putchar|exit|_Exit|quick_exit|abort|terminate) *\(|std::(cout|cerr|clog)|#[[:space:]]*include[[:space:]]*<iostream>' \
        core vdb trainer export bench)

# --- 4. licence -----------------------------------------------------------------------------------------------

scripts() {
    find core vdb trainer export bench cli tests examples cmake -name CMakeLists.txt -o -name '*.cmake' \
        -o -name '*.sh' 2>/dev/null | sort
    for file in CMakeLists.txt run .ci/run; do
        if [[ -f $file ]]; then printf '%s\n' "$file"; fi
    done
}
report "SPDX-License-Identifier: Apache-2.0 belongs in the first two lines" < <(
    { sources core vdb trainer export bench cli tests examples; scripts; } | while IFS= read -r file; do
        head -n 2 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0' || printf '%s\n' "$file:1:"
    done)

if [[ $breaches -gt 0 ]]; then
    printf '%s\n' "$breaches breaches of the law of the house"
    exit 1
fi
printf '%s\n' "$(sources core vdb trainer export bench cli | wc -l) source files keep the law"
