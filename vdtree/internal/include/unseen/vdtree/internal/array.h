// A finished array of a tree: its own memory, or a view of a mapped file.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace unseen::vdtree {

// Move-only and constant. The owner of a view's memory must outlive it.
template <class T>
class Array {
public:
    using value_type = T;

    Array() = default;
    Array(std::vector<T>&& values) : owned_(std::move(values)), view_(owned_) {}
    explicit Array(std::span<const T> view) : view_(view) {}
    Array(Array&& other) noexcept : owned_(std::move(other.owned_)), view_(std::exchange(other.view_, {})) {}
    Array& operator=(Array&& other) noexcept {
        owned_ = std::move(other.owned_);
        view_ = std::exchange(other.view_, {});
        return *this;
    }

    const T& operator[](std::size_t i) const noexcept { return view_[i]; }
    const T* data() const noexcept { return view_.data(); }
    std::size_t size() const noexcept { return view_.size(); }
    bool empty() const noexcept { return view_.empty(); }
    auto begin() const noexcept { return view_.begin(); }
    auto end() const noexcept { return view_.end(); }

    // What is allocated, or what is mapped.
    std::size_t bytes() const noexcept { return owned_.empty() ? view_.size_bytes() : owned_.capacity() * sizeof(T); }

private:
    std::vector<T> owned_;
    std::span<const T> view_;
};

} // namespace unseen::vdtree
