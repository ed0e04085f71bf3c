// SPDX-License-Identifier: Apache-2.0
// Numbers from the front of bytes that may be too few.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>

#include "core/error.h"

namespace nerfvdb {

static_assert(std::endian::native == std::endian::little, "numbers are read as they lie in memory");

/// Borrows bytes and takes little-endian numbers from their front; too few are a DataError at `where`.
class ByteReader {
public:
    ByteReader(std::span<const std::uint8_t> bytes, std::string where, std::string advice = {})
        : rest_(bytes), where_(std::move(where)), advice_(std::move(advice)) {}

    /// `what` they are, in a few words, for the error.
    std::span<const std::uint8_t> take(std::size_t count, const char* what) {
        if (rest_.size() < count)
            throw DataError(where_, std::to_string(rest_.size()) + " bytes at the end",
                            std::to_string(count) + " of " + what, advice_);
        const auto taken = rest_.first(count);
        rest_ = rest_.subspan(count);
        return taken;
    }
    template <typename T>
    T number(const char* what) {
        static_assert(std::is_arithmetic_v<T>);
        T value;
        std::memcpy(&value, take(sizeof value, what).data(), sizeof value);
        return value;
    }
    std::span<const std::uint8_t> rest() const { return rest_; }
    std::size_t left() const { return rest_.size(); }
    const std::string& where() const { return where_; }

private:
    std::span<const std::uint8_t> rest_;
    std::string where_, advice_;
};

}  // namespace nerfvdb
