// SPDX-License-Identifier: Apache-2.0
// What a full disk looks like to a writer, without filling one.
#pragma once

#include <sys/resource.h>

#include <csignal>

namespace nerfvdb {

/// Files of this process cannot grow beyond a size: what a full disk looks like to the one who writes.
class SmallDisk {
public:
    explicit SmallDisk(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
        getrlimit(RLIMIT_FSIZE, &old_limit_);
        const rlimit limit{bytes, old_limit_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~SmallDisk() {
        setrlimit(RLIMIT_FSIZE, &old_limit_);
        std::signal(SIGXFSZ, old_handler_);
    }

private:
    rlimit old_limit_{};
    void (*old_handler_)(int);
};

}  // namespace nerfvdb
