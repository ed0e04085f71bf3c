// SPDX-License-Identifier: Apache-2.0
#include "core/frequency_encoding.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("frequency encoding follows its definition up to the tenth octave") {
    for (const float x : {-1.0f, -0.37f, 0.0f, 0.123456f, 0.9f}) {
        float out[20];
        frequencyEncoding(x, 10, out);
        for (int k = 0; k < 10; ++k) {
            const double angle = std::ldexp(3.14159265358979323846 * static_cast<double>(x), k);
            CHECK(out[2 * k] == Approx(std::sin(angle)).margin(1e-6));  // single precision of values up to 1
            CHECK(out[2 * k + 1] == Approx(std::cos(angle)).margin(1e-6));
        }
    }
}

TEST_CASE("its backward is the derivative") {
    const float slopes[8] = {0.3f, -0.7f, 1.0f, 0.2f, -0.5f, 0.9f, -0.1f, 0.4f};
    for (const float x : {-0.8f, 0.05f, 0.61f}) {
        float out[8];
        frequencyEncoding(x, 4, out);
        const float found = frequencyEncodingBackward(4, out, slopes);
        const auto loss = [&](double at) {
            double sum = 0;
            for (int k = 0; k < 4; ++k) {
                const double angle = std::ldexp(3.14159265358979323846 * at, k);
                sum += static_cast<double>(slopes[2 * k]) * std::sin(angle) +
                       static_cast<double>(slopes[2 * k + 1]) * std::cos(angle);
            }
            return sum;
        };
        const double difference = (loss(static_cast<double>(x) + 1e-5) - loss(static_cast<double>(x) - 1e-5)) / 2e-5;
        CHECK(found == Approx(difference).margin(1e-4));  // curvature: (8 pi)^3 / 6 * 1e-10 ~ 3e-7; floats: 25 * 1e-6
    }
}
