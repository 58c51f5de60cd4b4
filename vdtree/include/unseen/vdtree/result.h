// A value or the reason why there is none: what every fallible function of Unseen returns.
//
// The member names are those of C++23's std::expected. Libraries never print and never throw for bad
// data; a broken precondition is a programmer's error and asserts. Taking the value of a Result that holds an error is
// never undefined: the program ends with the error's sentence, in every build.
#pragma once

#include <cassert>
#include <concepts>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace unseen {

enum class ErrorCode {
    io_failure,       // the operating system refused to open, read, write or rename
    malformed_data,   // a file or a mesh contradicts itself or its format
    unsupported,      // valid, but more than this build or this machine can do
    invalid_argument, // a value outside its stated range
    cancelled,        // the caller's progress callback asked to stop
};

// A sentence for people, of an error, a warning or a note. It is a string that knows which of its parts are names of
// the library ("request.fold_test", "Follower::set_glide()"), so that a program can show its own names instead.
class Message : public std::string {
public:
    Message() = default;
    Message(std::string text) : std::string(std::move(text)) {}
    Message(const char* text) : std::string(text) {}

    // In `text`, "{name}" marks a name and "{}" stands for the next of `values`. These are inserted as they are: the
    // name of a file is never taken for one of the library.
    static Message of(std::string_view text, std::initializer_list<std::string_view> values = {});

    struct Name {
        std::size_t begin = 0, size = 0;
    };
    std::span<const Name> names() const noexcept { return names_; } // from left to right

    static Message joined(const Message& a, const Message& b);

private:
    std::vector<Name> names_;
};

// Text before or after a message keeps its names.
template <class A, class B>
requires std::same_as<std::remove_cvref_t<A>, Message> || std::same_as<std::remove_cvref_t<B>, Message>
    Message operator+(A&& a, B&& b) {
    return Message::joined(std::forward<A>(a), std::forward<B>(b));
}

// What went wrong, as one sentence for people that names the file, line or index, and what to do.
struct Error {
    ErrorCode code = ErrorCode::invalid_argument;
    Message message;

    // The field at fault: the first name in the message, or empty.
    std::string_view field() const;
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
