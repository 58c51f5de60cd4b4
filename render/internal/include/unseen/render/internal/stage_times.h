// GPU times of a frame's stages, available some frames later.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/vdtree/result.h>

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
    StageTimes(StageTimes&&) noexcept;
    StageTimes& operator=(StageTimes&&) noexcept;
    ~StageTimes();

    void begin();     // begins a frame; one that was not ended is discarded
    void end_stage(); // a stage begins at the end of the one before
    void end();       // ends the frame

    // Milliseconds by stage for each frame that the GPU has finished since the last call, in order.
    std::vector<std::vector<double>> take();

private:
    struct Impl;
    explicit StageTimes(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
