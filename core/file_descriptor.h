// SPDX-License-Identifier: Apache-2.0
// POSIX files by descriptor: closed by themselves, read and written whole, their failures IoErrors with advice.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

namespace nerfvdb {

/// A POSIX file descriptor that closes itself.
class Descriptor {
public:
    Descriptor(const std::filesystem::path& path, int flags, mode_t mode = 0666);
    ~Descriptor();
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    bool isOpen() const { return fd_ >= 0; }

private:
    int fd_;
};

/// A plain file, open to be read. Folders, pipes and devices are IoErrors: a pipe that nobody writes to would be waited for, and a
/// device need not end.
class PlainFile {
public:
    explicit PlainFile(const std::filesystem::path& path);
    int get() const { return file_.get(); }
    std::size_t size() const { return size_; }  // when it was opened

private:
    Descriptor file_;
    std::size_t size_ = 0;
};

/// IoError: "PATH: found what errno says, expected EXPECTED", and what can be done about it.
[[noreturn]] void throwErrno(const std::filesystem::path& path, int error_number, const std::string& expected);

/// What can be done about an error number; may be empty.
std::string adviceFor(int error_number);

/// Writes all of `bytes` at the descriptor's position. Throws IoError that names `path`.
void writeAll(int fd, std::span<const std::byte> bytes, const std::filesystem::path& path);

/// Reads into `bytes`, less only where the file ends; how many. Throws IoError that names `path`.
std::size_t readAll(int fd, std::span<std::byte> bytes, const std::filesystem::path& path);

}  // namespace nerfvdb
