// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_index.h"

#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "blocks.json");
    fuzz::isRead([&] {
        const BlockIndex index = readBlockIndex(file);
        fuzz::require(index.views.size() == index.grid.blocks().size(), "a count of views for each block");
        for (const BlockId& block : index.grid.blocks())
            fuzz::require(fuzz::liesInside(blockPath(file.parent_path(), block), file.parent_path()),
                          "models inside the folder");
    });
    return 0;
}
