// SPDX-License-Identifier: Apache-2.0
#include "trainer/open_scene.h"

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "trainer/house_row.h"
#include "trainer/street_scene.h"

using namespace nerfvdb;

namespace {

double unit(std::uint64_t stream, std::uint64_t index) { return (randomBits(3, stream, index) >> 11) * 0x1p-53; }

Vec3d unitVector(std::uint64_t index) {
    const double z = 2 * unit(3, index) - 1, a = 6.283185307179586 * unit(4, index), r = std::sqrt(1 - z * z);
    return {r * std::cos(a), r * std::sin(a), z};
}

Vec3d pointIn(const Box& box, std::uint64_t index) {
    return box.min + box.size().cwiseProduct(Vec3d(unit(0, index), unit(1, index), unit(2, index)));
}

SyntheticDatasetOptions smallPictures() {
    SyntheticDatasetOptions options;
    options.train_views = 6, options.val_views = 0, options.test_views = 2;
    options.width = 32, options.height = 24;
    return options;
}

/// Where the bodies and the ground of a scene stand; points of tests come from here.
Box middleOf(const std::string& name) {
    if (name == "survey") return Box{{-10, -20, -0.5}, {110, 20, 20}};
    return name == "street" ? Box{{-10, -20, -0.5}, {70, 20, 20}} : Box{{-35, -35, -0.5}, {35, 35, 20}};
}

std::unique_ptr<OpenScene> sceneNamed(const std::string& name) {
    return makeOpenScene(name, name == "street" ? std::optional(60.0) : std::nullopt);
}

/// The first surface along a ray in steps of 2 mm: slow and obvious.
double marchedDistance(const OpenScene& scene, const Ray& ray, double farthest) {
    for (double t = 0; t < farthest; t += 0.002)
        if (scene.distance(ray.origin + t * ray.direction) < 0) return t;
    return std::numeric_limits<double>::infinity();
}

}  // namespace

TEST_CASE("an unknown open scene, and lengths that are none, are refused", "[open_scene]") {
    REQUIRE_THROWS_WITH(makeOpenScene("cathedral"), Catch::Contains("cathedral") && Catch::Contains("plaza, street, survey"));
    REQUIRE_THROWS_AS(makeOpenScene("plaza", 100.0), UsageError);
    for (const double length : {0.0, -5.0, 11.9, 1e9, std::nan("")})
        REQUIRE_THROWS_WITH(makeOpenScene("street", length), Catch::Contains("--length"));
}

TEST_CASE("the row's nearest house is bounded by its layout", "[open_scene]") {
    const HouseRow row(7, 12.0, 5);
    const Box around{{-20, -15, -2}, {104, 25, 30}};
    bool is_honest = true;
    double near_difference = 0;
    int n_near = 0;
    for (std::uint64_t i = 0; i < 20000; ++i) {
        const Vec3d p = pointIn(around, i);
        const double bounded = row.distance(p), all = row.distanceToAll(p);
        if (bounded > 0) is_honest &= row.distanceToAll(p + bounded * (1 - 1e-9) * unitVector(i)) >= 0;
        is_honest &= (bounded < 0) == (all < 0);
        if (std::abs(all) > 0.3) continue;
        near_difference = std::max(near_difference, std::abs(bounded - all));
        ++n_near;
    }
    CHECK(n_near > 200);
    CHECK(is_honest);             // no house is nearer, whosever plot it stands on
    CHECK(near_difference == 0);  // and at the walls it is the same
}

TEST_CASE("open scenes: no body is nearer than the distance says, colours are colours", "[open_scene]") {
    for (const std::string& name : openSceneNames()) {
        INFO(name);
        const auto scene = sceneNamed(name);
        int n_outside = 0, n_inside = 0;
        bool is_honest = true, are_colours = true;
        const auto isColour = [](const Vec3d& c) { return c.allFinite() && c.minCoeff() >= 0 && c.maxCoeff() <= 1; };
        for (std::uint64_t i = 0; i < 20000; ++i) {
            const Vec3d p = pointIn(middleOf(name), i), direction = unitVector(i);
            const double d = scene->distance(p);
            n_inside += d < 0, n_outside += d > 0;
            if (d > 0) is_honest &= scene->distance(p + d * (1 - 1e-9) * direction) >= 0;
            are_colours &= isColour(scene->skyColour(direction)) && isColour(scene->bodyColour(p, direction)) &&
                           isColour(scene->groundColour({p.x(), p.y(), 0}, Vec3d::UnitZ()));
        }
        are_colours &= isColour(scene->groundColour({1e300, 1e200, 0}, Vec3d::UnitZ()));
        CHECK(n_inside > 500);
        CHECK(n_outside > 500);
        CHECK(is_honest);
        CHECK(are_colours);
    }
}

TEST_CASE("sphere tracing finds the surface that a slow march finds", "[open_scene]") {
    for (const std::string& name : openSceneNames()) {
        INFO(name);
        const auto scene = sceneNamed(name);
        const std::vector<Camera> cameras = scene->cameras(Split::train, smallPictures());
        int n_bodies = 0, n_ground = 0, n_sky = 0, n_wrong = 0;
        for (std::uint64_t i = 0; i < 240; ++i) {
            const Camera& camera = cameras[i % cameras.size()];
            const Ray ray = cameraRay(camera, camera.width * unit(0, i), camera.height * unit(1, i));
            const double ground = scene->ground(ray).t, body = marchedDistance(*scene, ray, std::min(ground, 60.0));
            const double found = firstHit(*scene, ray).t, expected = std::min(ground, body);
            if (expected > 60.0) {
                n_sky += std::isinf(found);
                n_wrong += found < 60.0;
                continue;
            }
            (body < ground ? n_bodies : n_ground) += 1;
            // A ray that only grazes a body meets it to within the tracer's nearness, not to within the march's step.
            const bool grazes = scene->distance(ray.origin + found * ray.direction) < 1e-4 + 3e-4 * found;
            n_wrong += std::abs(found - expected) > 0.01 && !(found < expected && grazes);
        }
        CHECK(n_wrong == 0);
        CHECK(n_bodies > 40);
        CHECK(n_ground > 20);
        CHECK((n_sky > 5) == (name != "survey"));  // which looks down
    }
}

TEST_CASE("the ground of the street: road, kerbs and pavement", "[open_scene]") {
    const auto scene = makeOpenScene("street", 60.0);
    const auto along = [&](const Vec3d& origin, const Vec3d& direction) {
        return scene->ground({origin, direction.normalized()});
    };
    CHECK(along({30, 0, 1.6}, {0, 0, -1}).t == Approx(1.6));
    CHECK(along({30, 5, 1.6}, {0, 0, -1}).t == Approx(1.48));
    const SurfaceHit kerb = along({30, 0, 0.06}, {0, 1, 0});
    CHECK(kerb.t == Approx(3.5));
    CHECK(kerb.normal == Vec3d(0, -1, 0));
    CHECK(std::isinf(along({30, 0, 1.6}, {0, 1, 0}).t));
    CHECK(std::isinf(along({30, 0, 1.6}, {1, 0, 0.2}).t));
}

TEST_CASE("cameras of open scenes stand in the open, and splits do not repeat each other", "[open_scene]") {
    SyntheticDatasetOptions options;
    options.train_views = 120, options.test_views = 20, options.val_views = 10;
    CHECK(streetViews(200) == 120);
    for (const std::string& name : openSceneNames()) {
        INFO(name);
        const auto scene = makeOpenScene(name);
        const auto train = scene->cameras(Split::train, options), test = scene->cameras(Split::test, options);
        REQUIRE(train.size() == 120);
        REQUIRE(test.size() == 20);
        double nearest = 1e9, lowest = 1e9, highest = -1e9, clear = 1e9;
        for (const Camera& camera : train) {
            CHECK(cameraProblem(camera) == "");
            lowest = std::min(lowest, camera.position.z()), highest = std::max(highest, camera.position.z());
            clear = std::min(clear, scene->distance(camera.position));
            for (const Camera& other : test) nearest = std::min(nearest, (camera.position - other.position).norm());
        }
        const double floor = name == "survey" ? 38 : 0.8, ceiling = name == "survey" ? 42 : 2.6;
        CHECK(lowest > floor);
        CHECK(highest < ceiling);
        CHECK(clear > 0.5);
        CHECK(nearest > 0.005);
        if (name == "street") CHECK(train.back().position.x() - train.front().position.x() > 190);
    }
}

TEST_CASE("pictures of open scenes are opaque, exact, and the same on any number of threads", "[open_scene]") {
    const TempDir folder;
    Report report;
    for (const std::string& name : openSceneNames()) {
        INFO(name);
        const auto scene = sceneNamed(name);
        writeOpenDataset(*scene, folder / name, smallPictures(), report);
        const Dataset dataset = readDataset(folder / name, Split::train, {}, report);
        REQUIRE(dataset.views.size() == 6);
        CHECK(!dataset.has_alpha);
        const Camera camera = scene->cameras(Split::train, smallPictures())[2];
        const Photo& photo = dataset.views[2].photo;
        double worst = 0;
        for (int y = 0; y < photo.height; ++y)
            for (int x = 0; x < photo.width; ++x) {
                Vec3f light = Vec3f::Zero();
                for (const double dy : {0.25, 0.75})
                    for (const double dx : {0.25, 0.75}) {
                        const Vec3d colour = colourAlong(*scene, cameraRay(camera, x + dx, y + dy));
                        for (int c = 0; c < 3; ++c) light[c] += 0.25f * linearFromSrgb(static_cast<float>(colour[c]));
                    }
                for (int c = 0; c < 3; ++c)
                    worst = std::max(worst, std::abs(photo.at(x, y)[c] - 255.0 * srgbFromLinear(light[c])));
            }
        CHECK(worst < 0.501);  // half a level of rounding
        {
            const ThreadLimit one(1);
            writeOpenDataset(*scene, folder / (name + "1"), smallPictures(), report);
        }
        for (const char* file : {"train/r_5.png", "test/r_1.png", "transforms_train.json"})
            CHECK(readFile(folder / name / file) == readFile(folder / (name + "1") / file));
    }
}

TEST_CASE("a longer street begins as a shorter one does", "[open_scene]") {
    // Both have plots of 12 m exactly.
    const auto shorter = makeStreetScene(120), longer = makeStreetScene(1200);
    double difference = 0;
    for (std::uint64_t i = 0; i < 5000; ++i) {
        const Vec3d p = pointIn({{0, -14, 0}, {100, 14, 15}}, i);
        difference = std::max(difference, std::abs(shorter->distance(p) - longer->distance(p)));
    }
    CHECK(difference == 0);
}
