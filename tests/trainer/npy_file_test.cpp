// SPDX-License-Identifier: Apache-2.0
#include "trainer/npy_file.h"

#include <cmath>
#include <limits>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/trainer/npy_bytes.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

NpyMatrix read(const std::string& bytes) {
    const TempDir dir;
    writeAtomically(dir / "a.npy", bytes);
    return readNpyMatrix(dir / "a.npy");
}

std::string refusal(const std::string& bytes) {
    try {
        read(bytes);
        return "";
    } catch (const DataError& error) {
        CHECK_THAT(error.what(), Contains("a.npy: found"));
        return error.what();
    }
}

}  // namespace

TEST_CASE("matrices are read in every version, type and order", "[trainer]") {
    const std::vector<double> values{1, 2, 3, 4, 5, 6.5};
    for (const int version : {1, 2, 3})
        for (const bool is_fortran : {false, true})
            for (const bool is_double : {false, true}) {
                const NpyMatrix matrix = read(npyBytes(values, 2, 3, version, is_fortran, is_double));
                CAPTURE(version, is_fortran, is_double);
                CHECK(matrix.rows == 2);
                CHECK(matrix.columns == 3);
                CHECK(matrix.at(0, 1) == (is_fortran ? 3 : 2));
                CHECK(matrix.at(1, 0) == (is_fortran ? 2 : 4));
                CHECK(matrix.at(1, 2) == 6.5);
            }
    CHECK(read(npyBytes({}, 0, 17)).rows == 0);
    CHECK(std::isnan(read(npyBytes({NAN}, 1, 1)).at(0, 0)));
}

TEST_CASE("what is no matrix is refused", "[trainer]") {
    const std::string good = npyBytes({1, 2, 3, 4, 5, 6}, 2, 3);
    for (std::size_t size = 0; size < good.size(); ++size) CHECK_FALSE(refusal(good.substr(0, size)).empty());
    CHECK_THAT(refusal(good + "12345678"), Contains("56 bytes of values, expected 2x3 of 8"));
    CHECK_THAT(refusal(good + "1"), Contains("49 bytes"));
    const auto with = [](const std::string& dict) { return refusal(npyHead(dict, 1) + std::string(48, '\0')); };
    CHECK_THAT(refusal("PK\3\4 a zip"), Contains("no .npy file"));
    std::string later = good;
    later[6] = 4;
    CHECK_THAT(refusal(later), Contains("version 4"));
    CHECK_THAT(with("{'descr': '>f8', 'fortran_order': False, 'shape': (2, 3), }"), Contains("'>f8'") && Contains("astype"));
    CHECK_THAT(with("{'descr': '|O', 'fortran_order': False, 'shape': (2, 3), }"), Contains("'|O'"));
    CHECK_THAT(with("{'descr': '<f8', 'fortran_order': None, 'shape': (2, 3), }"), Contains("fortran_order"));
    CHECK_THAT(with("{'descr': '<f8', 'fortran_order': False, }"), Contains("no 'shape'"));
    CHECK_THAT(with("{'fortran_order': False, 'shape': (2, 3), }"), Contains("no 'descr'"));
    CHECK_THAT(with(""), Contains("no 'descr'"));
    for (const char* shape : {"(6,)", "()", "(2, 3, 1)", "(-2, 3)", "(2, x)", "2, 3", "(2, 3", "(99999999999999999999, 3)"})
        CHECK_THAT(with("{'descr': '<f8', 'fortran_order': False, 'shape': " + std::string(shape) + ", }"),
                   Contains("the shape"));
    // Products that wrap around to 48 bytes, and counts that no memory holds.
    for (const char* shape : {"(4611686018427387904, 4)", "(4611686018427387910, 4)", "(18446744073709551615, 1)",
                              "(0, 18446744073709551615)", "(6, 0)", "(3, 3)"})
        CHECK_THAT(with("{'descr': '<f8', 'fortran_order': False, 'shape': " + std::string(shape) + ", }"),
                   Contains("48 bytes of values"));
}
