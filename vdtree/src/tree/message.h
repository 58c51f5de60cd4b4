// Arrays of plain numbers as bytes, for processes that run the same program on the same kind of machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace unseen::vdtree {

// Appends arrays to a message: their length, then their elements.
class MessageWriter {
public:
    template <class T>
    void operator()(const std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T>);
        const std::uint64_t count = values.size();
        append(&count, sizeof(count));
        append(values.data(), values.size() * sizeof(T));
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    void operator()(const T& value) { append(&value, sizeof(T)); }
    std::span<const std::byte> bytes() const { return bytes_; }

private:
    void append(const void* from, std::size_t size) {
        if (size == 0) return;
        const auto* begin = static_cast<const std::byte*>(from);
        bytes_.insert(bytes_.end(), begin, begin + size);
    }

    std::vector<std::byte> bytes_;
};

// Reads them back in the same order. What a message is too short for stays empty, and complete() is false.
class MessageReader {
public:
    explicit MessageReader(std::span<const std::byte> bytes) : rest_(bytes) {}

    template <class T>
    void operator()(std::vector<T>& values) {
        std::uint64_t count = 0;
        (*this)(count);
        if (!(count <= rest_.size() / sizeof(T))) return fail();
        values.resize(count);
        take(values.data(), count * sizeof(T));
    }
    template <class T>
    requires std::is_arithmetic_v<T>
    void operator()(T& value) {
        if (rest_.size() < sizeof(T)) return fail();
        take(&value, sizeof(T));
    }
    bool complete() const { return !failed_ && rest_.empty(); }

private:
    void take(void* to, std::size_t size) {
        if (size != 0) std::memcpy(to, rest_.data(), size);
        rest_ = rest_.subspan(size);
    }
    void fail() {
        failed_ = true;
        rest_ = {};
    }

    std::span<const std::byte> rest_;
    bool failed_ = false;
};

} // namespace unseen::vdtree
