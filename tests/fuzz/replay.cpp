// SPDX-License-Identifier: Apache-2.0
// A main() for targets that are built without libFuzzer: runs the inputs in the files and folders that it is given,
// each within ten seconds and all within two gigabytes.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <vector>

#include "core/atomic_file.h"
#include "tests/fuzz/reader.h"

namespace {

namespace fs = std::filesystem;

constexpr unsigned kSeconds = 10;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // whose shadows take more than any limit
constexpr rlim_t kBytes = rlim_t{2} << 30;
#define NERFVDB_LIMITS_MEMORY
#endif

std::vector<fs::path> inputsOf(int argc, char** argv) {
    std::vector<fs::path> inputs;
    for (int i = 1; i < argc; ++i) {
        if (!fs::is_directory(argv[i])) inputs.emplace_back(argv[i]);
        else
            for (const fs::directory_entry& entry : fs::directory_iterator(argv[i])) inputs.push_back(entry.path());
    }
    std::sort(inputs.begin(), inputs.end());
    return inputs;
}

}  // namespace

int main(int argc, char** argv) {
#ifdef NERFVDB_LIMITS_MEMORY
    const rlimit limit{kBytes, kBytes};
    setrlimit(RLIMIT_DATA, &limit);
#endif
    const std::vector<fs::path> inputs = inputsOf(argc, argv);
    if (inputs.empty()) {
        std::cerr << "found no input, expected files or folders of them" << std::endl;
        return 2;
    }
    for (const fs::path& input : inputs) {
        std::cout << input.string() << std::endl;  // the last one named is the one that ended the program
        const std::string bytes = nerfvdb::readFile(input);
        alarm(kSeconds);
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
        alarm(0);
    }
    std::cout << "survived: " << inputs.size() << " of " << inputs.size() << " inputs" << std::endl;
}
