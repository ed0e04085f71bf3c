// SPDX-License-Identifier: Apache-2.0
// Anything that pictures can be made of: a model, a plain volume, a folder of blocks.
#pragma once

#include "core/camera.h"
#include "vdb/picture.h"

namespace nerfvdb {

/// A loaded scene that renders itself. Threads: render from one at a time; it uses all of them.
class Scene {
public:
    virtual ~Scene() = default;
    virtual RenderedImage render(const Camera& camera) const = 0;
    virtual Vec3f background() const = 0;  // sRGB values
    /// Of the leaves that hold something, world units; of a scene without bounds its inner box.
    virtual Box occupiedBox() const = 0;
};

}  // namespace nerfvdb
