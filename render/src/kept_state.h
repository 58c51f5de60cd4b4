// What Unseen's calls change of a GL context's state, kept for those that others own.
#pragma once

#include <functional>
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
    ~KeptState() {
        for (const auto& restore : restores_) restore();
    }

private:
    void keep(std::function<void()> restore) { restores_.push_back(std::move(restore)); }
    void keep_blending(GLuint buffer);
    void keep_window(GLuint number);
    void keep_unit(GLuint unit);
    void keep_storage(GLuint binding);

    std::vector<std::function<void()>> restores_; // in this order
};

} // namespace unseen::render
