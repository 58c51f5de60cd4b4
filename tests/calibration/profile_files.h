// Profile files for the tests: written to the tests' temporary folder, and spoilt in many ways.
#pragma once

#include <unistd.h>

#include "testing.h"

namespace unseen::calibration {

// A folder of this test's own, empty at its start and removed at its end.
class ProfileFiles : public testing::Test {
protected:
    ProfileFiles()
        : folder_(std::filesystem::path(testing::TempDir()) / ("unseen-profile-" + std::to_string(::getpid()))) {
        std::filesystem::remove_all(folder_);
        std::filesystem::create_directories(folder_);
    }
    ~ProfileFiles() override { std::filesystem::remove_all(folder_); }

    const std::filesystem::path& folder() const { return folder_; }
    std::filesystem::path write(std::string_view text, const std::string& name = "profile.json") const {
        const std::filesystem::path file = folder_ / name;
        std::ofstream(file, std::ios::binary) << text;
        return file;
    }
    static std::string read(const std::filesystem::path& file) {
        std::ifstream stream(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }
    std::ptrdiff_t files_in_folder() const {
        return std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator());
    }

private:
    std::filesystem::path folder_;
};

inline std::string replaced(std::string text, std::string_view from, std::string_view to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return at == text.npos ? text : text.replace(at, from.size(), to);
}

// Calls `check` with `text` cut off at every byte, and with bytes overwritten, removed and doubled at random.
template <class Check>
void for_each_mutation(const std::string& text, int random_mutations, Check check) {
    for (std::size_t length = 0; length < text.size(); ++length) check(text.substr(0, length));
    std::mt19937 engine(1);
    constexpr std::string_view bytes("{}[],:\"0123456789.eE+-ntf \n\x80\xff\0", 30);
    for (int i = 0; i < random_mutations; ++i) {
        std::string mutated = text;
        for (auto n = 1 + engine() % 3; n > 0; --n) {
            const std::size_t at = engine() % mutated.size();
            switch (engine() % 3) {
            case 0: mutated[at] = bytes[engine() % bytes.size()]; break;
            case 1: mutated.erase(at, 1 + engine() % 4); break;
            default: mutated.insert(at, mutated.substr(at, 1 + engine() % 4)); break;
            }
        }
        check(mutated);
    }
}

} // namespace unseen::calibration
