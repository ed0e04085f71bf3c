// SPDX-License-Identifier: Apache-2.0
// Rays spread evenly over pictures: one through a random pixel of every square of pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "core/camera.h"
#include "core/random.h"

namespace nerfvdb {

/// Edge of the squares, in pixels, at which all cameras together have about `rays` of them.
inline int squareEdge(std::span<const Camera> cameras, double rays) {
    double pixels = 0;
    for (const Camera& camera : cameras) pixels += static_cast<double>(camera.width) * camera.height;
    return std::max(1, static_cast<int>(std::sqrt(pixels / rays) + 0.5));
}

/// The squares of one camera's picture, in blocks of 16 x 16 for one thread each. Borrows the camera.
class PixelSquares {
public:
    static constexpr int kBlock = 16;

    /// `view` makes the random pixels of one camera differ from another's.
    PixelSquares(const Camera& camera, std::size_t view, int edge)
        : camera_(camera), view_(view), edge_(edge), columns_((camera.width + edge - 1) / edge),
          rows_((camera.height + edge - 1) / edge), blocks_x_((columns_ + kBlock - 1) / kBlock) {}

    std::size_t blockCount() const {
        return static_cast<std::size_t>(blocks_x_) * static_cast<std::size_t>((rows_ + kBlock - 1) / kBlock);
    }

    /// Calls visit(ray) for the rays of a block, at most kBlock * kBlock.
    template <typename Visit>
    void forEachRay(std::size_t block, const Visit& visit) const {
        const int x0 = static_cast<int>(block) % blocks_x_ * kBlock, y0 = static_cast<int>(block) / blocks_x_ * kBlock;
        for (int y = y0; y < std::min(y0 + kBlock, rows_); ++y)
            for (int x = x0; x < std::min(x0 + kBlock, columns_); ++x) {
                const std::uint64_t bits = randomBits(0, view_, static_cast<std::uint64_t>(y) * columns_ + x);
                const int px = std::min(x * edge_ + static_cast<int>(bits % edge_), camera_.width - 1);
                const int py = std::min(y * edge_ + static_cast<int>((bits >> 32) % edge_), camera_.height - 1);
                visit(cameraRay(camera_, px + 0.5, py + 0.5));
            }
    }

private:
    const Camera& camera_;
    std::size_t view_;
    int edge_, columns_, rows_, blocks_x_;
};

}  // namespace nerfvdb
