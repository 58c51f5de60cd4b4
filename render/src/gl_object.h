// OpenGL objects that own their names: move-only, deleted with the last owner, labelled for debuggers.
//
// Everything here needs a current context, also to be destroyed. An object with id 0 owns nothing: a
// default-constructed or moved-from one.
#pragma once

#include <initializer_list>
#include <string_view>
#include <utility>

namespace unseen::render {

enum class GlKind {
    buffer,
    vertex_array,
    texture_2d,
    texture_2d_array,
    timestamp, // a query of when the GPU comes to it
    framebuffer,
    program,
    sampler
};

// Makes an object with a label for debug messages and debuggers. 0 if GL refuses.
unsigned make_object(GlKind kind, std::string_view label);
void delete_object(GlKind kind, unsigned id) noexcept;

// Whether destroyed objects of this thread are deleted. Called whenever a context was to be made current: if that failed,
// the names would be those of another context.
void let_objects_go(bool are_in_current_context) noexcept;

template <GlKind kind>
class GlObject {
public:
    GlObject() noexcept = default;

    static GlObject create(std::string_view label = {}) { return GlObject(make_object(kind, label)); }

    GlObject(GlObject&& other) noexcept : id_(std::exchange(other.id_, 0u)) {}
    GlObject& operator=(GlObject&& other) noexcept {
        std::swap(id_, other.id_); // the old object goes with `other`
        return *this;
    }
    ~GlObject() {
        if (id_ != 0) delete_object(kind, id_);
    }

    unsigned id() const noexcept { return id_; }
    explicit operator bool() const noexcept { return id_ != 0; }

private:
    explicit GlObject(unsigned id) noexcept : id_(id) {}
    unsigned id_ = 0;
};

using Buffer = GlObject<GlKind::buffer>;
using VertexArray = GlObject<GlKind::vertex_array>;
using Texture2d = GlObject<GlKind::texture_2d>;
using Texture2dArray = GlObject<GlKind::texture_2d_array>;
using Timestamp = GlObject<GlKind::timestamp>;
using FramebufferObject = GlObject<GlKind::framebuffer>;
using ProgramObject = GlObject<GlKind::program>;
using Sampler = GlObject<GlKind::sampler>;

void disable(std::initializer_list<unsigned> capabilities);

// As pixels in memory lie, whatever others have set.
void reset_pixel_stores();

} // namespace unseen::render
