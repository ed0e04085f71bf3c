// SPDX-License-Identifier: Apache-2.0
#include "core/optimizer.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("Adam's first steps are those computed by hand") {
    Adam adam;
    adam.beta1 = 0.5f;
    adam.beta2 = 0.75f;
    adam.epsilon = 0.25f;
    std::vector<float> p{1.0f, -2.0f};
    const float rate = 0.1f;

    // Step 1, g = (2, 0): m = 1, v = 1; corrected m / 0.5 = 2, v / 0.25 = 4; p -= 0.1 * 2 / (2 + 0.25).
    adam.step(p, std::vector<float>{2.0f, 0.0f}, rate);
    CHECK(p[0] == Approx(1 - 0.1 * 2 / 2.25));
    CHECK(p[1] == -2.0f);
    CHECK(adam.count == 1);

    // Step 2, g = (-1, 4): m = (0, 2), v = (0.75 + 0.25, 4); corrections 0.75 and 0.4375.
    const double before = p[0];
    adam.step(p, std::vector<float>{-1.0f, 4.0f}, rate);
    CHECK(p[0] == Approx(before));
    CHECK(p[1] == Approx(-2 - 0.1 * (2 / 0.75) / (std::sqrt(4 / 0.4375) + 0.25)));

    // Step 3, g = (1, 0): m = (0.5, 1), v = (0.75 + 0.25, 3); corrections 0.875 and 0.578125.
    adam.step(p, std::vector<float>{1.0f, 0.0f}, rate);
    CHECK(p[0] == Approx(before - 0.1 * (0.5 / 0.875) / (std::sqrt(1 / 0.578125) + 0.25)));
}

TEST_CASE("Adam's first step has the length of the rate, whatever the gradient's scale") {
    for (const float scale : {1e-6f, 1.0f, 1e6f}) {
        Adam adam;
        std::vector<float> p{0.0f};
        adam.step(p, std::vector<float>{-scale}, 0.01f);
        // epsilon = 1e-8 shortens it by 1 % at a gradient of 1e-6.
        CHECK(p[0] == Approx(0.01f).epsilon(0.011));
    }
}
