#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# law_test.sh LAW SCRATCH: law.sh must find each kind of breach in a small bad tree, and no more.
set -euo pipefail
law=$1
scratch=$2

rm -rf "$scratch"
mkdir -p "$scratch"/{core,vdb,trainer,export,bench,cli}
spdx='// SPDX-License-Identifier: Apache-2.0'

write() { printf '%s\n' "${@:2}" >"$scratch/$1"; }
write core/good.cpp "$spdx" '#include "core/good.h"' '// exit(1) in a comment is no exit' 'int transmit(int);' \
    'int x = snprintf(0, 0, "");'
if ! "$law" "$scratch" >/dev/null; then
    echo "a good tree is refused"
    exit 1
fi

write core/up.cpp "$spdx" '#include "vdb/topology.h"'
write vdb/up.h "$spdx" '#include "trainer/dataset.h"'
write trainer/sideways.cpp "$spdx" '#include "export/mesh.h"'
write export/sideways.cpp "$spdx" '#  include "trainer/trainer.h"'
write trainer/measure.cpp "$spdx" '#include "bench/repeat.h"'
write bench/up.cpp "$spdx" '#include "cli/text.h"'
write bench/words.cpp "$spdx" '#include <nlohmann/json.hpp>'
write bench/print.cpp "$spdx" '#include <iostream>'
write core/tree.cpp "$spdx" '#include <openvdb/openvdb.h>'
write vdb/header.h "$spdx" '#include <openvdb/tree/Tree.h>'
write export/grids.cpp "$spdx" '#include <openvdb/openvdb.h>'
write trainer/threads.cpp "$spdx" '#include <tbb/parallel_for.h>'
write trainer/picture.cpp "$spdx" '#include <OpenImageIO/imageio.h>'
write vdb/lanes.cpp "$spdx" '#include <hwy/highway.h>'
write export/words.cpp "$spdx" '#include <nlohmann/json.hpp>'
write export/fewer.cpp "$spdx" '#include <meshoptimizer.h>'
write export/scene.h "$spdx" '#include <tiny_gltf.h>'
write vdb/leave.cpp "$spdx" 'void f() { exit(1); }'
write core/print.cpp "$spdx" 'void f() { std::cout << 1; }'
write core/print_c.cpp "$spdx" 'void f() { printf("1"); }'
write cli/licence.cpp 'int main() {}'

found=$("$law" "$scratch") && {
    echo "a bad tree is accepted"
    exit 1
}
status=0
for file in core/up.cpp vdb/up.h trainer/sideways.cpp export/sideways.cpp trainer/measure.cpp bench/up.cpp \
    bench/words.cpp bench/print.cpp core/tree.cpp vdb/header.h export/grids.cpp \
    trainer/threads.cpp trainer/picture.cpp vdb/lanes.cpp export/words.cpp export/fewer.cpp export/scene.h \
    vdb/leave.cpp core/print.cpp \
    core/print_c.cpp cli/licence.cpp; do
    grep -q "^$file:" <<<"$found" || { echo "not found: $file"; status=1; }
done
grep -q '^22 breaches' <<<"$found" || { echo "$found"; status=1; }
exit $status
