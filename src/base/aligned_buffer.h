#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>

namespace tomofield::base {

/// A zero-initialised array of plain values, aligned for any SIMD vector. A large array is also
/// aligned for huge pages and asks the kernel for them, because slab columns stride over many 4 KiB
/// pages and would otherwise miss the TLB. Pages of a large array that are never written take no
/// memory. Throws std::bad_alloc.
template <typename T>
class AlignedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(std::size_t size) { reset(size); }
  AlignedBuffer(AlignedBuffer&&) noexcept = default;
  AlignedBuffer& operator=(AlignedBuffer&&) noexcept = default;

  /// Replaces the contents by `size` zeros.
  void reset(std::size_t size) {
    data_.reset();
    size_ = size;
    if (size == 0) return;
    const std::size_t bytes = size * sizeof(T);
    if (bytes >= 2 * kHugePage) {
      data_ = map_zeros((bytes + kHugePage - 1) / kHugePage * kHugePage);
    } else {
      const std::size_t rounded = (bytes + kCacheLine - 1) / kCacheLine * kCacheLine;
      // Sets the deleter too, because the memory that is replaced may have been mapped.
      data_ = Memory(static_cast<T*>(std::aligned_alloc(kCacheLine, rounded)), Free{});
      if (!data_) throw std::bad_alloc();
      fill(T{});
    }
  }

  /// Grows to at least `size`; the contents are then unspecified.
  void reserve(std::size_t size) {
    if (size > size_) reset(size);
  }

  void fill(T value) { std::fill_n(data_.get(), size_, value); }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  operator std::span<T>() { return {data(), size_}; }
  operator std::span<const T>() const { return {data(), size_}; }

 private:
  static constexpr std::size_t kCacheLine = 64;
  static constexpr std::size_t kHugePage = std::size_t{2} << 20;
  struct Free {
    std::size_t mapped_bytes = 0;  // 0: the memory is from the heap
    void operator()(T* p) const {
      if (mapped_bytes > 0)
        munmap(p, mapped_bytes);
      else
        std::free(p);
    }
  };
  using Memory = std::unique_ptr<T[], Free>;

  // Returns whole huge pages of zeros. It maps one page too many and unmaps both unaligned ends.
  static Memory map_zeros(std::size_t bytes) {
    void* mapped = mmap(nullptr, bytes + kHugePage, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapped == MAP_FAILED) throw std::bad_alloc();
    char* const first = static_cast<char*>(mapped);
    const std::size_t past = reinterpret_cast<std::uintptr_t>(first) % kHugePage;
    const std::size_t before = past == 0 ? 0 : kHugePage - past;
    if (before > 0) munmap(first, before);
    if (before < kHugePage) munmap(first + before + bytes, kHugePage - before);
    madvise(first + before, bytes, MADV_HUGEPAGE);
    return Memory(reinterpret_cast<T*>(first + before), Free{bytes});
  }

  Memory data_;
  std::size_t size_ = 0;
};

}  // namespace tomofield::base
