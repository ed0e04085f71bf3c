// SPDX-License-Identifier: Apache-2.0
#include "cli/pictures_for_eyes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"

namespace nerfvdb {

Image depthForEyes(const Image& depth) {
    const float farthest = *std::max_element(depth.pixels.begin(), depth.pixels.end());
    float nearest = farthest;
    for (const float value : depth.pixels)
        if (value > 0) nearest = std::min(nearest, value);
    Image picture(depth.width, depth.height, 1);
    for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
        if (depth.pixels[i] <= 0) continue;
        const float share =
            farthest > nearest ? std::log(depth.pixels[i] / nearest) / std::log(farthest / nearest) : 0.0f;
        picture.pixels[i] = 1.0f - 0.9f * share;
    }
    return picture;
}

Image normalsForEyes(const Image& normal) {
    Image picture = normal;
    for (float& value : picture.pixels) value = 0.5f + 0.5f * value;
    return picture;
}

Image sideBySide(std::span<const Image> pictures) {
    int width = 0;
    for (const Image& picture : pictures) {
        if (picture.height != pictures.front().height || (picture.channels != 1 && picture.channels != 3))
            throw UsageError("sideBySide",
                             "a picture of " + std::to_string(picture.height) + " rows and " +
                                 std::to_string(picture.channels) + " channels",
                             "all of one height, and of 1 or 3 channels");
        width += picture.width;
    }
    Image row(width, pictures.empty() ? 0 : pictures.front().height, 3);
    int left = 0;
    for (const Image& picture : pictures) {
        for (int y = 0; y < picture.height; ++y)
            for (int x = 0; x < picture.width; ++x)
                for (int c = 0; c < 3; ++c)
                    row.at(left + x, y)[c] = picture.at(x, y)[picture.channels == 3 ? c : 0];
        left += picture.width;
    }
    return row;
}

}  // namespace nerfvdb
