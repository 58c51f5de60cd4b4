// Who keeps what, checked by the compiler: views of callables cannot be kept, options own their callbacks, and what
// must be kept by reference refuses temporaries.
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::vdtree {
namespace {

using View = FunctionRef<int(int)>;
using Lambda = decltype([](int i) { return i; });

// As a parameter, a view binds anything that can be called.
static_assert(std::is_constructible_v<View, Lambda> && std::is_constructible_v<View, Lambda&>);
static_assert(std::is_invocable_v<void (*)(const View&), Lambda> && std::is_invocable_v<void (*)(View), Lambda>);
static_assert(!std::is_constructible_v<View, int> && !std::is_constructible_v<View, std::nullptr_t>);

// There is no way to keep it: neither by a member that is set later, nor by a copy, nor within an owner.
static_assert(!std::is_default_constructible_v<View>);
static_assert(!std::is_assignable_v<View&, Lambda> && !std::is_assignable_v<View&, Lambda&>);
static_assert(!std::is_assignable_v<View&, View> && !std::is_assignable_v<View&, const View&>);
static_assert(!std::is_copy_constructible_v<View> && !std::is_move_constructible_v<View>);

struct KeepsAView {
    View view;
};
static_assert(!std::is_default_constructible_v<KeepsAView> && !std::is_move_constructible_v<KeepsAView> &&
              !std::is_assignable_v<KeepsAView&, KeepsAView>);
template <class Options, class F>
concept can_set_view = requires(Options options, F f) {
    options.view = f;
};
static_assert(!can_set_view<KeepsAView, Lambda>);

// Options own what they are given.
template <class Options>
concept owns_progress = requires(Options options) {
    options.progress = [](double, const char*) { return true; };
    requires std::is_same_v<decltype(options.progress), Callback<bool(double, const char*)>>;
    requires std::is_copy_assignable_v<Options>;
};
static_assert(owns_progress<BuildOptions> && owns_progress<meshio::ReadOptions>);

// What cannot be copied is kept only where that is said, and is no temporary.
struct Unique {
    explicit Unique(int);
    Unique(const Unique&) = delete;
    bool operator()(double, const char*);
};
static_assert(!std::is_convertible_v<Unique, std::reference_wrapper<Unique>>);
template <class T>
concept can_refer_to = requires(T&& value) {
    std::ref(std::forward<T>(value));
};
static_assert(can_refer_to<Unique&> && !can_refer_to<Unique>);
static_assert(std::is_assignable_v<Progress&, std::reference_wrapper<Unique>>);

// A clusterer's mesh is a view of its own, not a reference to one.
static_assert(std::is_same_v<decltype(ClusterInput::mesh), MeshView>);

} // namespace
} // namespace unseen::vdtree
