// SPDX-License-Identifier: Apache-2.0
// Which pixels of a photograph count. A pixel that does not is not known: it is neither learned nor scored. Alpha says
// something else: a transparent pixel is known to show nothing of the scene.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace nerfvdb {

/// One bit a pixel, in tiles of 8x8 pixels as rays are drawn from. Empty: every pixel counts.
class PixelMask {
public:
    static constexpr int kTile = 8;  // pixels along the side of a tile

    PixelMask() = default;
    /// No pixel counts yet.
    PixelMask(int width, int height)
        : width_(width), height_(height), tiles_x_((width + kTile - 1) / kTile),
          tiles_(static_cast<std::size_t>(tiles_x_) * ((height + kTile - 1) / kTile)) {}

    bool empty() const { return tiles_.empty(); }
    int width() const { return width_; }
    int height() const { return height_; }

    bool counts(int x, int y) const { return empty() || (tile(x / kTile, y / kTile) >> bit(x, y) & 1) != 0; }
    /// Bit 8 (y mod 8) + (x mod 8) of each pixel; of a mask that is not empty.
    std::uint64_t tile(int tile_x, int tile_y) const {
        return tiles_[static_cast<std::size_t>(tile_y) * tiles_x_ + tile_x];
    }
    void keep(int x, int y) {
        tiles_[static_cast<std::size_t>(y / kTile) * tiles_x_ + x / kTile] |= std::uint64_t{1} << bit(x, y);
    }
    /// Number of pixels that count; of a mask that is not empty.
    std::size_t count() const {
        std::size_t n = 0;
        for (const std::uint64_t word : tiles_) n += static_cast<std::size_t>(std::popcount(word));
        return n;
    }
    const std::vector<std::uint64_t>& tiles() const { return tiles_; }

    bool operator==(const PixelMask&) const = default;

private:
    static int bit(int x, int y) { return kTile * (y % kTile) + x % kTile; }
    int width_ = 0, height_ = 0, tiles_x_ = 0;
    std::vector<std::uint64_t> tiles_;
};

}  // namespace nerfvdb
