// What Unseen's calls change of a GL context's state, kept for those that others own.
#pragma once

#include <array>
#include <vector>

#include "gl.h"

namespace unseen::render {

// Reads the state of the current context when it is made, and sets it again when it goes. Cost: some hundred queries of
// the driver, which answers from memory: tens of microseconds. The contents of framebuffers, textures and buffers are
// not kept, nor is what no call of Unseen changes.
class KeptState {
public:
    KeptState();
    KeptState(const KeptState&) = delete;
    KeptState& operator=(const KeptState&) = delete;
    ~KeptState();

private:
    static constexpr GLuint unit_count = 24;   // of textures and samplers: above all that Unseen binds to
    static constexpr GLuint storage_count = 8; // of storage buffers, likewise
    static constexpr GLuint most_viewports = 16, most_draw_buffers = 8;

    struct Blend {
        GLint source_rgb, target_rgb, source_alpha, target_alpha, rgb, alpha;
        bool is_on;
        std::array<GLboolean, 4> mask;
    };
    struct Window {
        std::array<GLfloat, 4> viewport;
        std::array<GLint, 4> scissor;
        std::array<GLdouble, 2> depth_range;
        bool is_scissored;
    };
    struct Storage {
        GLint buffer;
        GLint64 start, size;
    };

    std::vector<bool> switches_;
    std::vector<GLint> stores_;
    std::vector<GLint> buffers_; // by target
    std::vector<Blend> blends_;
    std::vector<Window> windows_;
    std::vector<std::vector<GLint>> textures_; // by unit, those that are bound
    std::vector<GLint> samplers_;
    std::vector<Storage> storages_;
    GLint program_ = 0, vertex_array_ = 0, draw_framebuffer_ = 0, read_framebuffer_ = 0, clip_origin_ = 0,
          clip_depth_ = 0, depth_function_ = 0, cull_face_ = 0, front_face_ = 0, polygon_mode_ = 0;
    GLboolean depth_mask_ = 0;
};

} // namespace unseen::render
