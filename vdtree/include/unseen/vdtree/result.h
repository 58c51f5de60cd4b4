// A value or the reason why there is none: what every fallible function of Unseen returns.
//
// The member names are those of C++23's std::expected. Libraries never print and never throw for bad
// data; a broken precondition is a programmer's error and asserts. Taking the value of a Result that holds an error is
// never undefined: the program ends with the error's sentence, in every build.
#pragma once

#include <cassert>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <variant>

namespace unseen {

enum class ErrorCode {
    io_failure,       // the operating system refused to open, read, write or rename
    malformed_data,   // a file or a mesh contradicts itself or its format
    unsupported,      // valid, but more than this build or this machine can do
    invalid_argument, // a value outside its stated range
    cancelled,        // the caller's progress callback asked to stop
};

// What went wrong, as one sentence for people that names the file, line or index, and what to do.
struct Error {
    ErrorCode code = ErrorCode::invalid_argument;
    std::string message;
};

// Ends the program: somebody took the value of a Result that holds this error.
[[noreturn, gnu::cold, gnu::noinline]] inline void end_without_value(const Error& error) noexcept {
    std::fprintf(stderr, "value() of a Result that holds an error: %s\n", error.message.c_str());
    std::abort();
}

template <class T>
class [[nodiscard]] Result {
public:
    Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

    bool has_value() const noexcept { return state_.index() == 0; }
    explicit operator bool() const noexcept { return has_value(); }

    T& value() & { return checked(); }
    const T& value() const& { return const_cast<Result*>(this)->checked(); }
    T&& value() && { return std::move(checked()); }
    T& operator*() & { return checked(); }
    const T& operator*() const& { return value(); }
    T&& operator*() && { return std::move(checked()); }
    T* operator->() { return &checked(); }
    const T* operator->() const { return &value(); }

    const Error& error() const {
        assert(!has_value() && "error() of a Result that holds a value");
        return *std::get_if<1>(&state_);
    }

private:
    T& checked() {
        if (!has_value()) [[unlikely]]
            end_without_value(*std::get_if<1>(&state_));
        return *std::get_if<0>(&state_);
    }
    std::variant<T, Error> state_;
};

// The result of work that returns nothing.
template <>
class [[nodiscard]] Result<void> {
public:
    Result() = default;
    Result(Error error) : error_(std::move(error)), failed_(true) {}

    bool has_value() const noexcept { return !failed_; }
    explicit operator bool() const noexcept { return !failed_; }
    const Error& error() const {
        assert(failed_ && "error() of a Result that succeeded");
        return error_;
    }

private:
    Error error_;
    bool failed_ = false;
};

} // namespace unseen
