// SPDX-License-Identifier: Apache-2.0
// Runs a folder's tests. Exit code 77, which CTest knows as "skipped", when nothing ran but tests that lack
// their data.
#define CATCH_CONFIG_RUNNER
#include "tests/support/catch.h"
#include "tests/support/data.h"

namespace {

std::size_t n_run = 0;

struct CountTestCases : Catch::TestEventListenerBase {
    using TestEventListenerBase::TestEventListenerBase;
    void testCaseEnded(const Catch::TestCaseStats&) override { ++n_run; }
};
CATCH_REGISTER_LISTENER(CountTestCases)

}  // namespace

int main(int argc, char** argv) {
    const int failed = Catch::Session().run(argc, argv);
    if (failed != 0) return 1;
    return n_run > 0 && nerfvdb::testing::skippedTests() == n_run ? 77 : 0;
}
