#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

// Values keyed by dense ids that are never reused. Addresses are stable; iteration is in the order of ids.
template <class IdType, class T>
class IdTable {
 public:
  // Constructs a value from (id, args...).
  template <class... Args>
  T& Emplace(Args&&... args) {
    const IdType id(static_cast<uint32_t>(slots_.size()));
    slots_.push_back(std::make_unique<T>(id, std::forward<Args>(args)...));
    ++size_;
    return *slots_.back();
  }

  void Erase(IdType id) {
    DS_CHECK(Contains(id), "id={}", id.value());
    slots_[id.value()].reset();
    --size_;
  }

  bool Contains(IdType id) const { return id.value() < slots_.size() && slots_[id.value()] != nullptr; }
  const T* Find(IdType id) const { return id.value() < slots_.size() ? slots_[id.value()].get() : nullptr; }
  T* Find(IdType id) { return id.value() < slots_.size() ? slots_[id.value()].get() : nullptr; }
  const T& At(IdType id) const {
    const T* value = Find(id);
    DS_CHECK(value != nullptr, "id={}", id.value());
    return *value;
  }
  T& At(IdType id) { return const_cast<T&>(std::as_const(*this).At(id)); }

  size_t size() const { return size_; }
  size_t CreatedCount() const { return slots_.size(); }  // ids below this have existed

  // fn(const T&) or fn(T&) for each value, oldest first.
  template <class Fn>
  void ForEach(Fn&& fn) const {
    for (const auto& slot : slots_) {
      if (slot != nullptr) fn(std::as_const(*slot));
    }
  }
  template <class Fn>
  void ForEach(Fn&& fn) {
    for (auto& slot : slots_) {
      if (slot != nullptr) fn(*slot);
    }
  }

 private:
  std::vector<std::unique_ptr<T>> slots_;
  size_t size_ = 0;
};

}  // namespace dynamic_slam
