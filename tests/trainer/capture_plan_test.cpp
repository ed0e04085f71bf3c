// SPDX-License-Identifier: Apache-2.0
#include "trainer/capture_plan.h"

#include <algorithm>
#include <cstdio>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using Catch::Contains;

namespace {

std::vector<std::string> numbered(int begin, int end, int stride = 1, const char* pattern = "frame_%05d.jpg") {
    std::vector<std::string> names;
    for (int i = begin; i < end; i += stride) {
        char name[64];
        std::snprintf(name, sizeof name, pattern, i);
        names.emplace_back(name);
    }
    return names;
}

/// Names without an order, as phones and messengers give them.
std::vector<std::string> unordered(int n) {
    std::vector<std::string> names;
    for (int i = 0; i < n; ++i) names.push_back("WA" + std::to_string(i * 7919LL * 104729 % 1000003) + "x.jpg");
    std::sort(names.begin(), names.end());
    return names;
}

std::vector<PhotoOrigin> origins(std::size_t n, const PhotoOrigin& origin = {1000, 800, "Maker", 24, false}) {
    return std::vector<PhotoOrigin>(n, origin);
}

CapturePlan plan(const std::vector<std::string>& names, const CaptureOptions& options = {}) {
    return planCapture(names, origins(names.size()), options, 2);
}

}  // namespace

TEST_CASE("few photographs are matched all with all, many by their order", "[trainer]") {
    CHECK(plan(numbered(0, 60)).matching == Matching::exhaustive);
    CHECK(plan(numbered(0, 60)).pairs == 60 * 59 / 2);
    CHECK(plan(numbered(0, 61)).matching == Matching::sequential);
    CHECK_THAT(plan(numbered(0, 61)).matching_reason, Contains("100 %"));
    CHECK(plan(unordered(61)).matching == Matching::exhaustive);
    CHECK(plan(numbered(0, 61), {.matching = Matching::exhaustive}).matching == Matching::exhaustive);
    CHECK(plan(numbered(0, 61), {.matching = Matching::exhaustive}).matching_reason == "as asked");
    CHECK(plan(unordered(9), {.matching = Matching::sequential}).matching == Matching::sequential);
}

TEST_CASE("photographs that all know their place are matched with their neighbours", "[trainer]") {
    const std::vector<std::string> names = numbered(0, 200);
    std::vector<PhotoOrigin> placed = origins(200, {1000, 800, "", 0, true});
    const CapturePlan spatial = planCapture(names, placed, {}, 2);
    CHECK(spatial.matching == Matching::spatial);
    CHECK(spatial.pairs == 200 * kSpatialNeighbours);
    placed[7].has_position = false;
    CHECK(planCapture(names, placed, {}, 2).matching == Matching::sequential);
    CHECK_THROWS_WITH(planCapture(names, placed, {.matching = Matching::spatial}, 2),
                      Contains("--matching: found spatial, but only 199 of 200 photographs"));
    CHECK(planCapture(numbered(0, 3), origins(3, {9, 9, "", 0, true}), {}, 2).pairs == 3);  // never more than all
}

TEST_CASE("pairs of a sequence are counted as COLMAP makes them", "[trainer]") {
    // Distances 1 to 9, and the powers of two up to 512: of 61 photographs, 16 and 32 beyond the nine.
    std::size_t pairs = 0;
    for (const int distance : {1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 32}) pairs += static_cast<std::size_t>(61 - distance);
    CHECK(plan(numbered(0, 61)).pairs == pairs);
}

TEST_CASE("numbered names count in long runs only", "[trainer]") {
    CHECK(numberedShare(numbered(0, 40)) == 1);
    CHECK(numberedShare(numbered(3, 400, 10)) == 1);      // every tenth frame
    CHECK(numberedShare(numbered(0, 19)) == 0);           // too short
    CHECK(numberedShare({}) == 0);
    CHECK(numberedShare(unordered(100)) < 0.3);

    std::vector<std::string> names = numbered(0, 100);    // dropped frames leave small gaps
    for (const int dropped : {80, 79, 41, 20}) names.erase(names.begin() + dropped);
    CHECK(numberedShare(names) == 1);

    names = numbered(0, 30);                              // two walks, and three single pictures
    for (const std::string& name : numbered(500, 530)) names.push_back(name);
    for (const char* name : {"gate.jpg", "house.jpg", "tree 2.jpg"}) names.emplace_back(name);
    CHECK(numberedShare(names) == Approx(60.0 / 63));

    names = numbered(0, 10);                              // many short runs
    for (int run = 1; run < 10; ++run)
        for (const std::string& name : numbered(1000 * run, 1000 * run + 10)) names.push_back(name);
    CHECK(numberedShare(names) == 0);

    CHECK(numberedShare(numbered(0, 25, 1, "20240101123456789012345%03d.jpg")) == 0);  // no counter is that long
}

TEST_CASE("one camera is shared by photographs of one size, camera and focal length", "[trainer]") {
    const std::vector<std::string> names = numbered(0, 4);
    std::vector<PhotoOrigin> photos = origins(4);
    CHECK(planCapture(names, photos, {}, 2).camera == CameraSharing::shared);
    CHECK_THAT(planCapture(names, photos, {}, 2).camera_reason, Contains("Maker"));

    photos[2].focal_length_mm = 50;
    CHECK(planCapture(names, photos, {}, 2).camera == CameraSharing::per_image);
    CHECK_THAT(planCapture(names, photos, {}, 2).camera_reason, Contains("focal length"));
    CHECK(planCapture(names, photos, {.camera = CameraSharing::shared}, 2).camera == CameraSharing::shared);
    photos[2].camera = "Other";
    CHECK_THAT(planCapture(names, photos, {}, 2).camera_reason, Contains("camera"));
    photos[2].height = 801;
    CHECK_THAT(planCapture(names, photos, {}, 2).camera_reason, Contains("size"));
    CHECK_THROWS_WITH(planCapture(names, photos, {.camera = CameraSharing::shared}, 2),
                      Contains("--camera: found shared, but photographs of several sizes"));
}

TEST_CASE("predicted times grow with pairs, pixels and features, and shrink with cores", "[trainer]") {
    const std::vector<std::string> names = numbered(0, 20);
    const auto planned = [&](int width, const CaptureOptions& options, int threads) {
        return planCapture(names, origins(20, {width, width, "", 0, false}), options, threads);
    };
    const CapturePlan base = planned(1000, {}, 1);
    CHECK(planned(1000, {}, 4).matching_seconds == Approx(base.matching_seconds / 4));
    CHECK(planned(500, {}, 1).features_seconds == Approx(base.features_seconds / 4));
    CHECK(planned(1000, {.max_size = 500}, 1).features_seconds == Approx(base.features_seconds / 4));
    CHECK(planned(1000, {.max_features = 500}, 1).matching_seconds < base.matching_seconds);
    CHECK(planned(9000, {}, 1).features_seconds == Approx(planned(1600, {}, 1).features_seconds));

    // Measured, COLMAP 3.8, user time: 28 pairs of 7728 features 20.0 s, of 5121 11.5 s, of 2757 5.8 s.
    CHECK(matchingSeconds(28, 7728, 1) == Approx(20.0).epsilon(0.25));
    CHECK(matchingSeconds(28, 5121, 1) == Approx(11.5).epsilon(0.25));
    CHECK(matchingSeconds(28, 2757, 1) == Approx(5.8).epsilon(0.4));
}

TEST_CASE("a prediction reads as one", "[trainer]") {
    CHECK(roughTime(3) == "a few seconds");
    CHECK(roughTime(41) == "about 40 seconds");
    CHECK(roughTime(100) == "about 2 minutes");
    CHECK(roughTime(4000) == "about 67 minutes");
    CHECK(roughTime(9000) == "about 2.5 hours");
    CHECK(roughTime(90000) == "about 25 hours");
}
