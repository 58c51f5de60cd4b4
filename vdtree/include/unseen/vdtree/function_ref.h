// Callables as parameters (FunctionRef, a view) and as members (Callback, an owner).
#pragma once

#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

namespace unseen {

template <class Signature>
class FunctionRef;

// Refers to any callable with the signature R(Args...), for the time of one call: two words, one indirect call, no
// allocation. Take it as `const FunctionRef<...>&`, to which temporaries bind. There is no empty one, and it can be
// neither copied nor assigned, so options cannot have one, nor can a std::function: what is to be kept is a Callback.
template <class R, class... Args>
class FunctionRef<R(Args...)> {
public:
    template <class F>
    requires(!std::is_same_v<std::remove_cvref_t<F>, FunctionRef> && std::is_invocable_r_v<R, F&, Args...>)
        FunctionRef(F&& callable)
    noexcept
        : object_(const_cast<void*>(static_cast<const void*>(std::addressof(callable)))),
          call_([](void* object, Args... args) -> R {
              return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...);
          }) {}
    FunctionRef(const FunctionRef&) = delete;
    FunctionRef& operator=(const FunctionRef&) = delete;
    template <class F>
    FunctionRef& operator=(F&&) = delete;

    R operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

private:
    void* object_;
    R (*call_)(void*, Args...);
};

// Owns a copy of its callable, so it may be kept, as in options; empty by default. To keep a reference to something
// that is not to be copied, say so with std::ref(), which refuses temporaries: it must outlive the callback.
template <class Signature>
using Callback = std::function<Signature>;

// Called now and then on the calling thread by long work: the share done, 0..1, and what is being done.
// Return false to cancel; the work then ends with ErrorCode::cancelled and leaves nothing behind.
using Progress = Callback<bool(double share_done, const char* stage)>;

} // namespace unseen
