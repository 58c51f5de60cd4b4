// OpenGL objects that own their names: move-only, deleted with the last owner, labelled for debuggers.
//
// Everything here needs a current context, also to be destroyed. An object with id 0 owns nothing: a
// default-constructed or moved-from one.
#pragma once

#include <string_view>
#include <utility>

namespace unseen::render {

// Makes, deletes and labels one kind of object. Defined for the kinds below.
struct BufferTraits;
struct VertexArrayTraits;
struct Texture2dTraits;
struct Texture2dArrayTraits;
struct TimestampTraits;
struct RenderbufferTraits;
struct FramebufferTraits;
struct ProgramTraits;
struct SamplerTraits;

// Whether objects that go on this thread are deleted: told whenever a context was to be made current. Where that failed
// the names would be those of another context.
void let_objects_go(bool are_in_current_context) noexcept;

template <class Traits>
class GlObject {
public:
    GlObject() noexcept = default;

    // A new object. The label shows up in debug messages and in debuggers. Id 0 where GL refuses.
    static GlObject create(std::string_view label = {});

    // Takes ownership of a name that other code made.
    static GlObject wrap(unsigned id) noexcept { return GlObject(id); }

    GlObject(GlObject&& other) noexcept : id_(other.release()) {}
    GlObject& operator=(GlObject&& other) noexcept {
        std::swap(id_, other.id_); // the old object goes with `other`
        return *this;
    }
    ~GlObject();

    unsigned id() const noexcept { return id_; }
    explicit operator bool() const noexcept { return id_ != 0; }

    // Gives up ownership: the caller deletes the object.
    unsigned release() noexcept { return std::exchange(id_, 0u); }

private:
    explicit GlObject(unsigned id) noexcept : id_(id) {}
    unsigned id_ = 0;
};

using Buffer = GlObject<BufferTraits>;
using VertexArray = GlObject<VertexArrayTraits>;
using Texture2d = GlObject<Texture2dTraits>;
using Texture2dArray = GlObject<Texture2dArrayTraits>;
using Timestamp = GlObject<TimestampTraits>; // a query of when the GPU comes to it
using Renderbuffer = GlObject<RenderbufferTraits>;
using FramebufferObject = GlObject<FramebufferTraits>;
using ProgramObject = GlObject<ProgramTraits>;
using Sampler = GlObject<SamplerTraits>;

extern template class GlObject<BufferTraits>;
extern template class GlObject<VertexArrayTraits>;
extern template class GlObject<Texture2dTraits>;
extern template class GlObject<Texture2dArrayTraits>;
extern template class GlObject<TimestampTraits>;
extern template class GlObject<RenderbufferTraits>;
extern template class GlObject<FramebufferTraits>;
extern template class GlObject<ProgramTraits>;
extern template class GlObject<SamplerTraits>;

} // namespace unseen::render
