// SPDX-License-Identifier: Apache-2.0
// A checkpoint; its content hash is made to fit, so that what stands behind it is read too.
#include "trainer/checkpoint.h"

#include "core/atomic_file.h"
#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    constexpr std::size_t kHashDigits = 32;
    std::string bytes(fuzz::textOf(data, size));
    const std::size_t begin = bytes.find('\n') + 1;  // 0: no line
    if (begin > 0 && bytes.size() > begin + kHashDigits) {
        const std::string_view body = std::string_view(bytes).substr(begin + kHashDigits + 1);
        bytes.replace(begin, kHashDigits, contentHash(std::as_bytes(std::span(body.data(), body.size()))));
    }
    const auto file = fuzz::fileOf(bytes, "checkpoint");
    fuzz::isRead([&] {
        TrainState state;
        TrainPlace place;
        loadCheckpoint(file, state, place);
        fuzz::require(place.stage < place.stages.size(), "a stage that there is");
    });
    return 0;
}
