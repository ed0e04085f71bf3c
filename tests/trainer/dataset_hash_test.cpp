// SPDX-License-Identifier: Apache-2.0
#include "trainer/dataset_hash.h"

#include <functional>
#include <set>

#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"

using namespace nerfvdb;

TEST_CASE("the hash of a data set tells apart whatever training would see") {
    const Dataset dataset = test::sphereDataset(Split::train, 3, 16);
    std::set<std::string> hashes = {datasetHash(dataset)};
    const auto is_new = [&](const std::function<void(View&)>& change) {
        Dataset other = dataset;
        change(other.views[1]);
        return hashes.insert(datasetHash(other)).second;
    };
    CHECK(is_new([](View& view) { ++view.camera.width; }));
    CHECK(is_new([](View& view) { ++view.camera.height; }));
    for (double Camera::*field : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy})
        CHECK(is_new([&](View& view) { view.camera.*field += 1e-9; }));
    using D = Distortion;
    for (double D::*field : {&D::k1, &D::k2, &D::k3, &D::p1, &D::p2, &D::k4, &D::k5, &D::k6})
        CHECK(is_new([&](View& view) { view.camera.distortion.*field += 1e-9; }));
    CHECK(is_new([](View& view) { view.camera.distortion.model = LensModel::fisheye; }));
    for (int i = 0; i < 9; ++i)
        CHECK(is_new([&](View& view) { view.camera.world_from_camera.data()[i] += 1e-9; }));
    for (int i = 0; i < 3; ++i) CHECK(is_new([&](View& view) { view.camera.position[i] += 1e-9; }));
    for (int i = 0; i < 4; ++i) CHECK(is_new([&](View& view) { view.photo.pixels[100][i] += 1; }));

    Dataset other = dataset;
    std::swap(other.views[0], other.views[1]);
    CHECK(hashes.insert(datasetHash(other)).second);
    other.views.pop_back();
    CHECK(hashes.insert(datasetHash(other)).second);
}

TEST_CASE("the hash of a data set depends on neither its place nor the threads") {
    const Dataset dataset = test::sphereDataset(Split::train, 3, 16);
    Dataset moved = dataset;
    moved.root = "elsewhere";
    for (View& view : moved.views) view.path = "elsewhere" / view.path;
    const ThreadLimit one(1);
    CHECK(datasetHash(moved) == datasetHash(dataset));
}
