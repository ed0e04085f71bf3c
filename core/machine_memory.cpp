// SPDX-License-Identifier: Apache-2.0
#include "core/machine_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>

namespace nerfvdb {

std::size_t machineMemory() {
    const std::size_t physical = static_cast<std::size_t>(::sysconf(_SC_PHYS_PAGES)) *
                                 static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    std::size_t allowed = 0;  // the file is absent, or says "max", where nothing is limited
    return std::ifstream("/sys/fs/cgroup/memory.max") >> allowed ? std::min(allowed, physical) : physical;
}

}  // namespace nerfvdb
