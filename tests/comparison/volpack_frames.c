/* Draws frames with VolPack: volpack_frames SCENE VOXELS FRAMES PICTURE
 *
 * SCENE holds numbers as measure.py writes them, VOXELS 16-bit voxels, x fastest. Prints a JSON object with the time of
 * each frame. The volume is classified once, run-length encoded, as the manual recommends for frames that share an
 * opacity transfer function; PICTURE is a PNM file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <volpack.h>

/* What is shaded comes first, so that encoded voxels hold nothing else: the normal, or the value of unshaded scenes. */
typedef struct {
    unsigned short shade, value;
} Voxel;

/* One more than VolPack's normals: no gradient, thus no light but the emissive. */
enum { NO_NORMAL = VP_NORM_MAX + 1, VALUES = 4096 };

static FILE *scene;

static void check(int good, const char *what) {
    if (!good) {
        fprintf(stderr, "volpack_frames: %s\n", what);
        exit(1);
    }
}

static double number(void) {
    double value = 0;
    check(fscanf(scene, "%lf", &value) == 1, "the scene ends too early");
    return value;
}

static double milliseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1e3 + now.tv_nsec * 1e-6;
}

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Central differences, towards lower values; the nearest voxel continues the volume. */
static unsigned short normal(const Voxel *voxels, const int *size, const double *spacing, const int *at) {
    double n[3], length;
    long stride = 1, here = at[0] + size[0] * (at[1] + (long)size[1] * at[2]);
    for (int axis = 0; axis < 3; stride *= size[axis++]) {
        long below = at[axis] > 0 ? -stride : 0, above = at[axis] < size[axis] - 1 ? stride : 0;
        n[axis] = (voxels[here + below].value - voxels[here + above].value) / spacing[axis];
    }
    length = sqrt(dot(n, n));
    return length > 0 ? vpNormalIndex(n[0] / length, n[1] / length, n[2] / length) : NO_NORMAL;
}

static Voxel *read_voxels(const char *path, const int *size, const double *spacing, int shaded) {
    long count = (long)size[0] * size[1] * size[2];
    unsigned short *values = malloc(count * sizeof *values);
    Voxel *voxels = malloc(count * sizeof *voxels);
    FILE *file = fopen(path, "rb");
    check(values && voxels && file && fread(values, sizeof *values, count, file) == (size_t)count, path);
    fclose(file);
    for (long place = 0; place < count; place++)
        voxels[place].shade = voxels[place].value = values[place];
    free(values);
    for (int at[3] = {0, 0, 0}; shaded && at[2] < size[2]; at[2]++)
        for (at[1] = 0; at[1] < size[1]; at[1]++)
            for (at[0] = 0; at[0] < size[0]; at[0]++)
                voxels[at[0] + size[0] * (at[1] + (long)size[1] * at[2])].shade = normal(voxels, size, spacing, at);
    return voxels;
}

/* Phong's formula for every normal: emissive, diffuse, specular and exponent, towards light and viewer. */
static void light(float *table, int channels, const double *color) {
    double material[4], to_light[3], eye[3];
    for (int i = 0; i < 4; i++) material[i] = number();
    for (int i = 0; i < 3; i++) to_light[i] = number();
    for (int i = 0; i < 3; i++) eye[i] = number();
    for (int index = 0; index <= NO_NORMAL; index++) {
        double n[3] = {0, 0, 0}, diffuse, reflected, specular = 0;
        if (index != NO_NORMAL) vpNormal(index, &n[0], &n[1], &n[2]);
        diffuse = fmax(0, dot(n, to_light));
        reflected = 2 * dot(n, to_light) * dot(n, eye) - dot(to_light, eye);
        if (diffuse > 0 && reflected > 0) specular = material[2] * pow(reflected, material[3]);
        for (int channel = 0; channel < channels; channel++) {
            double shade = color[channel] * (material[0] + material[1] * diffuse) + specular;
            table[index * channels + channel] = 255 * fmin(1, shade);
        }
    }
}

int main(int count, char **arguments) {
    static float opacity[VALUES], colors[3 * (NO_NORMAL + 1)];
    int size[3], shaded, channels, pixels;
    double spacing[3], color[3], least, scale, started, classified;
    vpMatrix4 view;
    check(count == 5, "SCENE VOXELS FRAMES PICTURE are wanted");
    scene = fopen(arguments[1], "r");
    check(scene != NULL, arguments[1]);
    for (int i = 0; i < 3; i++) size[i] = number();
    for (int i = 0; i < 3; i++) spacing[i] = number();
    for (int i = 0; i < 16; i++) view[i / 4][i % 4] = number();
    scale = number(), pixels = number(), shaded = number(), channels = number(), least = number();
    for (int i = 0; i < VALUES; i++) opacity[i] = number();
    if (shaded) {
        for (int i = 0; i < channels; i++) color[i] = number();
        light(colors, channels, color);
    } else {
        for (int i = 0; i < VALUES * channels; i++) colors[i] = 255 * number();
    }

    Voxel *voxels = read_voxels(arguments[2], size, spacing, shaded), *layout = voxels;
    vpContext *vpc = vpCreateContext();
    vpSetVolumeSize(vpc, size[0], size[1], size[2]);
    vpSetVoxelSize(vpc, sizeof(Voxel), 2, 1, 1);
    vpSetVoxelField(vpc, 0, 2, vpFieldOffset(layout, shade), shaded ? NO_NORMAL : VALUES - 1);
    vpSetVoxelField(vpc, 1, 2, vpFieldOffset(layout, value), VALUES - 1);
    vpSetRawVoxels(vpc, voxels, (int)sizeof(Voxel) * size[0] * size[1] * size[2], sizeof(Voxel),
                   sizeof(Voxel) * size[0], sizeof(Voxel) * size[0] * size[1]);
    vpSetClassifierTable(vpc, 0, 1, opacity, sizeof opacity);
    vpSetd(vpc, VP_MIN_VOXEL_OPACITY, least);
    vpSetd(vpc, VP_MAX_RAY_OPACITY, 0.95);
    started = milliseconds();
    check(vpClassifyVolume(vpc) == VP_OK, vpGetErrorString(vpGetError(vpc)));
    classified = milliseconds() - started;

    vpSetLookupShader(vpc, channels, 1, 0, colors, sizeof(float) * channels * (shaded ? NO_NORMAL + 1 : VALUES), 0,
                      NULL, 0);
    vpCurrentMatrix(vpc, VP_MODEL);
    vpSetMatrix(vpc, view);
    vpCurrentMatrix(vpc, VP_PROJECT);
    vpIdentityMatrix(vpc);
    check(vpWindow(vpc, VP_PARALLEL, -scale, scale, -scale, scale, -scale, scale) == VP_OK, "the window is refused");
    unsigned char *picture = malloc(pixels * pixels * channels);
    vpSetImage(vpc, picture, pixels, pixels, pixels * channels, channels == 1 ? VP_LUMINANCE : VP_RGB);
    printf("{\"classify_ms\": %f, \"ms\": [", classified);
    for (int frame = 0, frames = atoi(arguments[3]); frame <= frames; frame++) {
        double start = milliseconds();
        check(vpRenderClassifiedVolume(vpc) == VP_OK, vpGetErrorString(vpGetError(vpc)));
        /* The first frame allocates. */
        if (frame > 0) printf("%s%f", frame > 1 ? ", " : "", milliseconds() - start);
    }
    printf("]}\n");

    FILE *file = fopen(arguments[4], "wb");
    check(file != NULL, arguments[4]);
    fprintf(file, "P%d\n%d %d\n255\n", channels == 1 ? 5 : 6, pixels, pixels);
    /* VolPack's rows go upwards. */
    for (int row = pixels; row-- > 0;) fwrite(picture + row * pixels * channels, channels, pixels, file);
    fclose(file);
    return 0;
}
