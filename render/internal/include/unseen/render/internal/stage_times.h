// GPU times of a frame's stages, available some frames later.
#pragma once

#include <optional>

#include <unseen/render/context.h>

namespace unseen::render {

// Move-only; keeps a handle to the context. Nothing waits.
//
//     times->begin();
//     ... // the first stage
//     times->end_stage(); // and so on
//     times->end();
//     for (const auto& frame : times->take()) ...
class StageTimes {
public:
    static Result<StageTimes> create(const Context& context);
    StageTimes(StageTimes&&) noexcept = default;
    StageTimes& operator=(StageTimes&&) noexcept = default;

    void begin();     // begins a frame; one that was not ended is discarded
    void end_stage(); // a stage begins at the end of the one before
    void end();       // ends the frame

    // Milliseconds by stage for each frame that the GPU has finished since the last call, in order.
    std::vector<std::vector<double>> take();

private:
    struct Impl;
    explicit StageTimes(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
