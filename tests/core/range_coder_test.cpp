// SPDX-License-Identifier: Apache-2.0
#include "core/range_coder.h"

#include <cmath>
#include <vector>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

std::span<const std::uint8_t> asBytes(const std::string& text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// Laplacian integers of a given mean magnitude.
std::vector<int> laplacian(std::size_t n, double scale, std::uint64_t seed) {
    std::vector<int> values(n);
    for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t bits = randomBits(seed, 0, i);
        const double u = unitFloat(static_cast<std::uint32_t>(bits)) + 0x1p-25;
        values[i] = static_cast<int>(std::lround(-std::log(u) * scale)) * (bits >> 63 ? -1 : 1);
    }
    return values;
}

}  // namespace

TEST_CASE("range coder returns every bit, however unlikely") {
    // Long runs drive the models to their ends and the encoder into carries.
    for (const std::uint64_t rarity : {1, 2, 30, 5000}) {
        std::vector<bool> bits;
        for (std::size_t i = 0; i < 40000; ++i) bits.push_back(randomBits(1, rarity, i) % rarity == 0);
        RangeEncoder out;
        BitModel model;
        for (const bool bit : bits) out.bit(bit, model);
        const std::string bytes = out.finish();
        RangeDecoder in(asBytes(bytes));
        BitModel mirror;
        bool same = true;
        for (const bool bit : bits) same &= in.bit(mirror) == bit;
        CHECK(same);
        CHECK(in.atEnd());
    }
}

TEST_CASE("range coder returns raw bits of every width") {
    RangeEncoder out;
    for (std::size_t i = 0; i < 5000; ++i) {
        const int width = static_cast<int>(i % 33);
        out.raw(width ? static_cast<std::uint32_t>(randomBits(2, 0, i) >> (64 - width)) : 0u, width);
    }
    const std::string bytes = out.finish();
    RangeDecoder in(asBytes(bytes));
    bool same = true;
    for (std::size_t i = 0; i < 5000; ++i) {
        const int width = static_cast<int>(i % 33);
        same &= in.raw(width) == (width ? static_cast<std::uint32_t>(randomBits(2, 0, i) >> (64 - width)) : 0u);
    }
    CHECK(same);
    CHECK(in.atEnd());
}

TEST_CASE("integers come back and cost little more than their entropy") {
    for (const double scale : {0.0, 0.3, 20.0, 3000.0}) {
        std::vector<int> values = laplacian(60000, scale, 3);
        values.insert(values.end(), {0, 1, -1, 16383, -16384, 16384, (1 << 30) - 1, 1 - (1 << 30)});
        RangeEncoder out;
        IntegerModel model;
        for (const int value : values) model.encode(out, value);
        const std::string bytes = out.finish();
        RangeDecoder in(asBytes(bytes));
        IntegerModel mirror;
        bool same = true;
        for (const int value : values) same &= mirror.decode(in) == value;
        CHECK(same);
        CHECK(in.atEnd());
        // A Laplacian of mean magnitude b, rounded, has about log2(2 e b) bits; 0.15 for length classes, models.
        if (scale >= 20) CHECK(bytes.size() * 8.0 / values.size() < std::log2(2 * std::exp(1.0) * scale) + 0.15);
    }
}

TEST_CASE("wrong bytes decode to something, without reading past the end") {
    for (std::size_t size = 0; size < 40; ++size) {
        std::string bytes(size, '\0');
        for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(randomBits(4, size, i));
        RangeDecoder in(asBytes(bytes));
        IntegerModel model;
        for (int i = 0; i < 1000; ++i) {
            model.decode(in);
        }
        CHECK_FALSE(in.atEnd());
    }
}
