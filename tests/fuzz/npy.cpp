// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/reader.h"
#include "trainer/npy_file.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "input.npy");
    fuzz::isRead([&] {
        const NpyMatrix matrix = readNpyMatrix(file);
        fuzz::require(matrix.values.size() <= size, "no more values than bytes");
        fuzz::require(matrix.rows == 0 || matrix.values.size() / matrix.rows == matrix.columns, "rows times columns");
    });
    return 0;
}
