// SPDX-License-Identifier: Apache-2.0
// A model.vdb, sealed after the fuzzer has had its way with it: what stands behind the checksum is read too, and looked at.
#include <algorithm>
#include <cmath>

#include "tests/fuzz/reader.h"
#include "vdb/model_file.h"
#include "vdb/renderer.h"
#include "vdb/vdb_seal.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string bytes(fuzz::textOf(data, size));
    sealVdb(bytes);
    const auto file = fuzz::fileOf(bytes, "model.vdb");
    fuzz::isRead([&] {
        const Model model = loadModel(file);
        fuzz::require(model.background.allFinite() && model.field.frame().origin.allFinite(), "finite numbers");
        Camera camera;
        camera.width = camera.height = 4, camera.fx = camera.fy = 4, camera.cx = camera.cy = 2;
        const Box box = model.field.worldBox();
        camera.position = box.center() + Vec3d(0, 0, box.size().norm());  // looks along -z
        const RenderedImage picture = Renderer(model, {}).render(camera);
        fuzz::require(std::all_of(picture.rgb.pixels.begin(), picture.rgb.pixels.end(), [](float v) { return std::isfinite(v); }),
                      "a picture of finite numbers");
    });
    return 0;
}
