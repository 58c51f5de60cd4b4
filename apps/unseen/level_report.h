// What the frames with discrete levels came to: as JSON and in words.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <unseen/session_gpu/level_control.h>

#include "level_views.h"
#include "options.h"
#include "report.h"

namespace unseen::app {

struct LevelsArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {};
    session::LevelControlOptions control = {};
    std::string path = {}; // see camera_path.h; empty: one picture, of the view in which nothing changes any more
    std::string out = {};  // of pictures: with a path a name with one %d; empty: none
    std::string json = {};
    std::string selection = {}; // of the method `given`: a file, whose budget counts unless `what` has one
    std::optional<LevelView> show = {};
    double frames_a_second = 60;
    WhatOptions what = {};
    bool is_verbose = false;
};

struct LevelRecords {
    std::vector<session::LevelFrame> frames;
    std::uint64_t settling_frames = 0; // before the first

    // What has become known of frames that may be long gone; of those before the first nothing is kept.
    void learn(const session::LevelFrame& known) {
        for (const session::LevelTest& test : known.tests)
            if (session::LevelFrame* frame = numbered(test.frame)) frame->tests.push_back(test);
        for (const session::LevelTimes& times : known.times)
            if (session::LevelFrame* frame = numbered(times.frame)) frame->times.push_back(times);
    }
    void add(session::LevelFrame frame) {
        const session::LevelFrame known = frame;
        frame.tests.clear();
        frame.times.clear();
        frames.push_back(std::move(frame));
        learn(known);
    }

private:
    session::LevelFrame* numbered(std::uint64_t number) {
        if (frames.empty() || number < frames.front().number || number > frames.back().number) return nullptr;
        return &frames[static_cast<std::size_t>(number - frames.front().number)];
    }
};

Json to_json(const session::Session& session, const session::LevelControl& control, const LevelsArguments& options,
             const LevelRecords& records, int levels);
void print_summary(const LevelsArguments& options, const LevelRecords& records, const session::Session& session,
                   int levels);

} // namespace unseen::app
