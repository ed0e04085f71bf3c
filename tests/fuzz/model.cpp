// SPDX-License-Identifier: Apache-2.0
// A model.vdb, sealed after the fuzzer has had its way with it: what stands behind the checksum is read too.
#include "tests/fuzz/reader.h"
#include "vdb/model_file.h"
#include "vdb/vdb_seal.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string bytes(fuzz::textOf(data, size));
    sealVdb(bytes);
    const auto file = fuzz::fileOf(bytes, "model.vdb");
    fuzz::isRead([&] {
        const Model model = loadModel(file);
        fuzz::require(model.background.allFinite() && model.field.frame().origin.allFinite(), "finite numbers");
    });
    return 0;
}
