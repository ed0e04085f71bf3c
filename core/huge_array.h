// SPDX-License-Identifier: Apache-2.0
// A big plain array, aligned to pages, on transparent huge pages where the kernel grants them.
// Trilinear gathers touch memory at random; fewer TLB misses save 15 to 30 % of their time.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace nerfvdb {

/// std::bad_alloc that says how much was asked for.
class NoMemory : public std::bad_alloc {
public:
    explicit NoMemory(std::size_t bytes) {
        std::snprintf(text_, sizeof text_, "no memory for an array of %zu MiB", (bytes >> 20) + 1);
    }
    const char* what() const noexcept override { return text_; }

private:
    char text_[64];
};

/// Owns `size` values of a trivial type, zero at first. Movable, copied only by name (clone). Its pages come from the
/// system and go back to it, none before it is first written to. Throws NoMemory.
template <typename T>
class HugeArray {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    HugeArray() = default;
    explicit HugeArray(std::size_t size, T value = T{}) {
        if (size == 0) return;
        if (size > SIZE_MAX / 2 / sizeof(T)) throw NoMemory(SIZE_MAX / 2);
        const std::size_t bytes = mappedBytes(size);
        const std::size_t page = bytes >= kHugePage ? kHugePage : kPage;
        const std::size_t spare = page - kPage;  // so that the array can begin at a huge page
        void* const map = ::mmap(nullptr, bytes + spare, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (map == MAP_FAILED) throw NoMemory(bytes);
        const std::size_t before = (page - reinterpret_cast<std::uintptr_t>(map) % page) % page;
        char* const begin = static_cast<char*>(map) + before;
        if (before > 0) ::munmap(map, before);
        if (spare > before) ::munmap(begin + bytes, spare - before);
        if (page == kHugePage) ::madvise(begin, bytes, MADV_HUGEPAGE);  // advice: a refusal costs speed only
        data_ = reinterpret_cast<T*>(begin);
        size_ = size;
        static constexpr T kZero{};
        if (std::memcmp(&value, &kZero, sizeof value) != 0) fill(value);
    }
    HugeArray(HugeArray&& other) noexcept { swap(other); }
    HugeArray& operator=(HugeArray&& other) noexcept {
        HugeArray taken(std::move(other));
        swap(taken);
        return *this;
    }
    ~HugeArray() {
        if (data_) ::munmap(data_, mappedBytes(size_));
    }

    HugeArray clone() const {
        HugeArray copy(size_);
        if (size_) std::memcpy(copy.data_, data_, size_ * sizeof(T));
        return copy;
    }
    void fill(T value) {
        for (std::size_t i = 0; i < size_; ++i) data_[i] = value;
    }
    /// Keeps the first `size` values, no more than there are; the pages of the others go back to the system.
    void truncate(std::size_t size) {
        if (size == 0) {
            *this = HugeArray();
            return;
        }
        const std::size_t kept = mappedBytes(size), bytes = mappedBytes(size_);
        if (kept < bytes) ::munmap(reinterpret_cast<char*>(data_) + kept, bytes - kept);
        size_ = size;
    }

    T* data() { return data_; }
    const T* data() const { return data_; }
    std::size_t size() const { return size_; }
    std::size_t bytes() const { return size_ * sizeof(T); }
    T& operator[](std::size_t i) { return data_[i]; }
    const T& operator[](std::size_t i) const { return data_[i]; }
    std::span<T> span() { return {data_, size_}; }
    std::span<const T> span() const { return {data_, size_}; }

private:
    static constexpr std::size_t kHugePage = std::size_t{2} << 20;
    static constexpr std::size_t kPage = 4096;
    static constexpr std::size_t mappedBytes(std::size_t size) {
        return (size * sizeof(T) + kPage - 1) / kPage * kPage;
    }
    void swap(HugeArray& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
    }
    T* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace nerfvdb
