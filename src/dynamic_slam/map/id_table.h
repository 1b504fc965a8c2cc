#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

// Values keyed by dense ids that are never reused. Addresses are stable; iteration is in the order of ids.
// Ids whose values are gone take no room once those beside them are gone too: a map that runs for days makes
// far more landmarks than it has.
template <class IdType, class T>
class IdTable {
 public:
  IdTable() = default;
  IdTable(IdTable&&) = default;
  IdTable& operator=(IdTable&&) = default;
  // The same values under the same ids, at addresses of their own.
  IdTable(const IdTable& other) : created_(other.created_), size_(other.size_) {
    for (const std::unique_ptr<Page>& page : other.pages_) {
      pages_.push_back(page != nullptr ? std::make_unique<Page>() : nullptr);
      if (page == nullptr) continue;
      pages_.back()->size = page->size;
      for (uint32_t i = 0; i < kPageSize; ++i) {
        if (page->slots[i] != nullptr) pages_.back()->slots[i] = std::make_unique<T>(*page->slots[i]);
      }
    }
  }

  // Constructs a value from (id, args...).
  template <class... Args>
  T& Emplace(Args&&... args) {
    const uint32_t id = created_;
    if (id % kPageSize == 0) pages_.push_back(std::make_unique<Page>());
    Page& page = *pages_.back();
    std::unique_ptr<T>& slot = page.slots[id % kPageSize];
    slot = std::make_unique<T>(IdType(id), std::forward<Args>(args)...);
    ++page.size;
    ++created_;
    ++size_;
    return *slot;
  }

  void Erase(IdType id) {
    DS_CHECK(Contains(id), "id={}", id.value());
    std::unique_ptr<Page>& page = pages_[id.value() / kPageSize];
    page->slots[id.value() % kPageSize].reset();
    --page->size;
    --size_;
    const bool is_full_of_ids = created_ / kPageSize > id.value() / kPageSize;
    if (page->size == 0 && is_full_of_ids) page.reset();
  }

  bool Contains(IdType id) const { return Find(id) != nullptr; }
  const T* Find(IdType id) const {
    if (id.value() >= created_) return nullptr;
    const Page* page = pages_[id.value() / kPageSize].get();
    return page != nullptr ? page->slots[id.value() % kPageSize].get() : nullptr;
  }
  T* Find(IdType id) { return const_cast<T*>(std::as_const(*this).Find(id)); }
  const T& At(IdType id) const {
    const T* value = Find(id);
    DS_CHECK(value != nullptr, "id={}", id.value());
    return *value;
  }
  T& At(IdType id) { return const_cast<T&>(std::as_const(*this).At(id)); }

  size_t size() const { return size_; }
  size_t CreatedCount() const { return created_; }  // ids below this have existed

  // fn(const T&) or fn(T&) for each value, oldest first. fn may erase it.
  template <class Fn>
  void ForEach(Fn&& fn) const {
    for (uint32_t id = 0; id < created_; id = Next(id)) {
      if (const T* value = Find(IdType(id)); value != nullptr) fn(*value);
    }
  }
  template <class Fn>
  void ForEach(Fn&& fn) {
    for (uint32_t id = 0; id < created_; id = Next(id)) {
      if (T* value = Find(IdType(id)); value != nullptr) fn(*value);
    }
  }

 private:
  static constexpr uint32_t kPageSize = 64;

  struct Page {
    std::array<std::unique_ptr<T>, kPageSize> slots;
    uint32_t size = 0;  // slots in use
  };

  // The id after this one, past a page that is gone.
  uint32_t Next(uint32_t id) const {
    return pages_[id / kPageSize] != nullptr ? id + 1 : (id / kPageSize + 1) * kPageSize;
  }

  std::vector<std::unique_ptr<Page>> pages_;
  uint32_t created_ = 0;
  size_t size_ = 0;
};

}  // namespace dynamic_slam
