// SPDX-License-Identifier: Apache-2.0
// Makes a procedural sphere and writes it as a volume that Blender opens. The same works for a trained scene:
// nerfvdb::loadModel("model.vdb") instead of sampleScene.
#include <iostream>

#include "core/error.h"
#include "export/vdb_export.h"
#include "trainer/sample_scene.h"
#include "trainer/synthetic_scene.h"

int main(int argc, char** argv) try {
    const std::filesystem::path path = argc > 1 ? argv[1] : "sphere.vdb";
    const auto scene = nerfvdb::makeSyntheticScene("sphere");
    const nerfvdb::Model model = nerfvdb::sampleScene(*scene, 64);
    nerfvdb::Report silent;
    const nerfvdb::ExportVdbReport report = nerfvdb::exportVdb(model, path, {}, silent);
    std::cout << path << ": " << report.active_voxels << " active voxels\n";
} catch (const nerfvdb::Error& error) {
    std::cerr << error.what() << '\n';
    return 1;
}
