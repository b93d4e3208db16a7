// Renders a baked scene on several threads: a complete program in C++17, with the objects of croupier in RAII types.
//
//     c++ -std=c++17 threads.cpp $(pkg-config --cflags --libs croupier) -pthread -o threads
//     ./threads box.crp box.ppm [THREADS]
//
// The picture depends on the number of shards, not on that of threads: the last line that it prints is the hash of
// embed-example/hashes.txt, B, on any number of threads (more than its eight shards have nothing to do).
#include <croupier.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

// Throws what the library says.
template <class Function, class... Arguments>
void call(Function function, Arguments... arguments) {
    croupier_message message;
    if (function(arguments..., &message) != CROUPIER_OK) throw std::runtime_error(message.text);
}

// Memory as the library wants it.
class Block {
public:
    explicit Block(std::size_t size)
        : size_(size), memory_(::operator new(size, std::align_val_t{CROUPIER_ALIGN})) {}
    void *data() const { return memory_.get(); }
    std::size_t size() const { return size_; }

private:
    struct Free {
        void operator()(void *p) const { ::operator delete(p, std::align_val_t{CROUPIER_ALIGN}); }
    };
    std::size_t size_;
    std::unique_ptr<void, Free> memory_;
};

class Scene {
public:
    explicit Scene(const std::vector<char> &bytes) : object_(CROUPIER_SCENE_BYTES), blob_(bytes.size()) {
        std::memcpy(blob_.data(), bytes.data(), bytes.size());
        call(croupier_scene_init, object_.data(), object_.size(), blob_.data(), blob_.size(), &scene_);
    }
    ~Scene() { croupier_scene_destroy(scene_, nullptr); }
    Scene(const Scene &) = delete;
    Scene &operator=(const Scene &) = delete;
    croupier_scene *get() const { return scene_; }

private:
    Block object_, blob_;
    croupier_scene *scene_ = nullptr;
};

class Shard {
public:
    Shard(const croupier_plan &plan, std::uint32_t index) : block_(size(plan, index)) {
        call(croupier_shard_init, block_.data(), block_.size(), &plan, index, &shard_);
    }
    ~Shard() { croupier_shard_destroy(shard_, nullptr); }
    Shard(const Shard &) = delete;
    Shard &operator=(const Shard &) = delete;
    croupier_shard *get() const { return shard_; }

private:
    static std::size_t size(const croupier_plan &plan, std::uint32_t index) {
        std::size_t bytes = 0;
        call(croupier_plan_shard_size, &plan, index, &bytes);
        return bytes;
    }
    Block block_;
    croupier_shard *shard_ = nullptr;
};

class Render {
public:
    Render(const Scene &scene, const croupier_settings &settings) : plan_(plan(settings)), block_(sizes().session) {
        call(croupier_session_init, block_.data(), block_.size(), &plan_, scene.get(), &session_);
        for (std::uint32_t i = 0; i < sizes().shards; i++) {
            shards_.push_back(std::make_unique<Shard>(plan_, i));
            handles_.push_back(shards_.back()->get());
        }
    }
    ~Render() { croupier_session_destroy(session_, nullptr); }
    Render(const Render &) = delete;
    Render &operator=(const Render &) = delete;

    croupier_sizes sizes() const {
        croupier_sizes sizes{};
        sizes.struct_size = sizeof sizes;
        call(croupier_plan_sizes, &plan_, &sizes);
        return sizes;
    }

    // One iteration: threads take the next shard until there is none.
    void iterate(std::uint32_t samples, unsigned threads) {
        call(croupier_session_begin_iteration, session_, samples);
        std::atomic<std::size_t> next{0};
        std::mutex mutex;
        std::exception_ptr failure;
        std::vector<std::thread> workers;
        for (unsigned t = 0; t < threads; t++) {
            workers.emplace_back([&] {
                try {
                    for (std::size_t i; (i = next++) < handles_.size();) {
                        std::uint32_t more = 1;
                        while (more) call(croupier_shard_step, handles_[i], session_, std::uint64_t{10000}, &more);
                    }
                } catch (...) {
                    std::lock_guard<std::mutex> lock(mutex);
                    failure = std::current_exception();
                }
            });
        }
        for (auto &worker : workers) worker.join();
        if (failure) std::rethrow_exception(failure);
        std::uint32_t more = 1;
        while (more)
            call(croupier_session_finish_iteration, session_, handles_.data(), handles_.size(), std::uint64_t{1000000}, &more);
    }

    std::vector<float> picture() const {
        std::vector<float> rgb(std::size_t{3} * sizes().width * sizes().height);
        call(croupier_session_rgb, session_, rgb.data(), rgb.size());
        return rgb;
    }

private:
    static croupier_plan plan(const croupier_settings &settings) {
        croupier_plan plan;
        call(croupier_plan_init, &plan, &settings);
        return plan;
    }
    croupier_plan plan_;
    Block block_;
    croupier_session *session_ = nullptr;
    std::vector<std::unique_ptr<Shard>> shards_;
    std::vector<croupier_shard *> handles_;
};

std::uint64_t hash(const std::vector<float> &values) {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (float x : values) {
        std::uint32_t bits;
        std::memcpy(&bits, &x, sizeof bits);
        for (int byte = 0; byte < 4; byte++) h = (h ^ (bits >> 8 * byte & 0xff)) * 0x100000001b3u;
    }
    return h;
}

void write_ppm(const char *path, const std::vector<float> &rgb, const croupier_sizes &sizes) {
    std::ofstream file(path, std::ios::binary);
    file << "P6\n" << sizes.width << ' ' << sizes.height << "\n255\n";
    for (float x : rgb) file.put(static_cast<char>(std::sqrt(std::clamp(x, 0.0f, 1.0f)) * 255.0f));
    file.close(); // what is still in memory may fail to be written, too
    if (!file) throw std::runtime_error(std::string("cannot write ") + path);
}

} // namespace

int main(int argc, char **argv) try {
    unsigned threads = std::max(2u, std::thread::hardware_concurrency());
    if (argc == 4) threads = static_cast<unsigned>(std::strtoul(argv[3], nullptr, 10));
    if (argc < 3 || argc > 4 || threads < 1 || threads > 1024) {
        std::fprintf(stderr, "usage: %s SCENE.crp PICTURE.ppm [THREADS, 1 to 1024]\n", argv[0]);
        return 2;
    }
    call(croupier_check_processor);
    std::fprintf(stderr, "croupier %s, %s, %u threads\n", croupier_version(), croupier_instruction_set(), threads);
    std::ifstream file(argv[1], std::ios::binary);
    if (!file) throw std::runtime_error(std::string("cannot read ") + argv[1]);
    std::vector<char> bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    Scene scene(bytes);

    croupier_settings settings;
    call(croupier_settings_init, &settings, scene.get());
    const char *const texts[][2] = {{"rrs", "ears"},          {"ring", "64"},         {"ledger", "256"},
                                    {"cache-bytes", "65536"}, {"split-budget", "64"}, {"pixel-estimator", "blocks"}};
    for (auto &text : texts) call(croupier_settings_set, &settings, text[0], text[1]);
    call(croupier_settings_set_shards, &settings, std::uint32_t{8});

    Render render(scene, settings);
    for (std::uint32_t samples : {2u, 2u, 4u}) render.iterate(samples, threads);
    const auto picture = render.picture();
    write_ppm(argv[2], picture, render.sizes());
    std::printf("%016llx\n", static_cast<unsigned long long>(hash(picture)));
    return 0;
} catch (const std::exception &e) {
    std::fprintf(stderr, "croupier: %s\n", e.what());
    return 1;
}
