// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_io.h"
#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "input.ply");
    fuzz::isRead([&] {
        const Mesh mesh = readPly(file);
        fuzz::require(mesh.positions.size() + mesh.triangles.size() <= size, "no more vertices and faces than bytes");
        checkTriangles(mesh);
    });
    return 0;
}
