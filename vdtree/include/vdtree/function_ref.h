// A non-owning reference to a callable: two words, one indirect call, no allocation.
#pragma once

#include <memory>
#include <type_traits>
#include <utility>

namespace unseen {

template <class Signature>
class FunctionRef;

// Refers to any callable with the signature R(Args...). The callable must outlive the reference, so
// take it as a parameter and do not keep it. An empty reference converts to false and must not be called.
template <class R, class... Args>
class FunctionRef<R(Args...)> {
public:
    FunctionRef() = default;
    FunctionRef(std::nullptr_t) {}

    template <class F>
        requires(!std::is_same_v<std::remove_cvref_t<F>, FunctionRef> && std::is_invocable_r_v<R, F&, Args...>)
    FunctionRef(F&& callable) noexcept
        : object_(const_cast<void*>(static_cast<const void*>(std::addressof(callable)))),
          call_([](void* object, Args... args) -> R {
              return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...);
          }) {}

    explicit operator bool() const noexcept { return call_ != nullptr; }
    R operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

private:
    void* object_ = nullptr;
    R (*call_)(void*, Args...) = nullptr;
};

// Called now and then on the calling thread by long work: the share done, 0..1, and what is being done.
// Return false to cancel; the work then ends with ErrorCode::cancelled and leaves nothing behind.
using Progress = FunctionRef<bool(double share_done, const char* stage)>;

} // namespace unseen
