// libFuzzer's entry points. A target first reads its own seeds and refuses to run if its readers reject one: fuzzing
// would then never get behind the check that fails.
#include "target.h"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    unseen::fuzz::accepts({reinterpret_cast<const char*>(data), size});
    return 0;
}

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    int read = 0, refused = 0;
    std::error_code missing;
    for (const auto& seed : std::filesystem::directory_iterator(UNSEEN_FUZZ_SEEDS, missing)) {
        std::ifstream stream(seed.path(), std::ios::binary);
        ++read;
        if (unseen::fuzz::accepts(std::string(std::istreambuf_iterator<char>(stream), {}))) continue;
        ++refused;
        std::fprintf(stderr, "The seed %s is refused.\n", seed.path().c_str());
    }
    if (read == 0) std::fprintf(stderr, "There are no seeds in %s: run make_fuzz_seeds.\n", UNSEEN_FUZZ_SEEDS);
    if (read == 0 || refused > 0) std::abort();
    return 0;
}
