// A Vulkan layer for tests on old software drivers (Mesa 22's lavapipe). slangpy always asks for two
// extensions that such a driver lacks, and our kernels need neither: the manifest beside this file
// says they are there, and the layer takes them out of every request.
#include <stdlib.h>
#include <string.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

static PFN_vkGetInstanceProcAddr next_instance_proc;
static PFN_vkGetDeviceProcAddr next_device_proc;

static int is_ours(const char* extension) {
  return strcmp(extension, "VK_KHR_shader_non_semantic_info") == 0 ||
         strcmp(extension, "VK_KHR_xlib_surface") == 0;
}

/// Copies to `kept` the names that the driver is to see; returns how many.
static uint32_t keep_others(const char* const* names, uint32_t count, const char** kept) {
  uint32_t n = 0;
  for (uint32_t i = 0; i < count; ++i)
    if (!is_ours(names[i])) kept[n++] = names[i];
  return n;
}

/// The loader's link to the next layer in the pNext chain of a create call.
static void* find_link(const void* next, VkStructureType type) {
  VkLayerInstanceCreateInfo* info = (VkLayerInstanceCreateInfo*)next;
  while (info && !(info->sType == type && info->function == VK_LAYER_LINK_INFO))
    info = (VkLayerInstanceCreateInfo*)info->pNext;
  return info;
}

static VkResult create_instance(const VkInstanceCreateInfo* info,
                                const VkAllocationCallbacks* allocator, VkInstance* instance) {
  VkLayerInstanceCreateInfo* link =
      find_link(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  if (!link) return VK_ERROR_INITIALIZATION_FAILED;
  next_instance_proc = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;

  VkInstanceCreateInfo copy = *info;
  const char** kept = calloc(info->enabledExtensionCount + 1, sizeof(*kept));
  if (!kept) return VK_ERROR_OUT_OF_HOST_MEMORY;
  copy.enabledExtensionCount =
      keep_others(info->ppEnabledExtensionNames, info->enabledExtensionCount, kept);
  copy.ppEnabledExtensionNames = kept;
  PFN_vkCreateInstance create = (PFN_vkCreateInstance)next_instance_proc(NULL, "vkCreateInstance");
  const VkResult result = create(&copy, allocator, instance);
  free(kept);
  return result;
}

static VkResult create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                              const VkAllocationCallbacks* allocator, VkDevice* device) {
  VkLayerDeviceCreateInfo* link =
      find_link(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  if (!link) return VK_ERROR_INITIALIZATION_FAILED;
  PFN_vkGetInstanceProcAddr instance_proc = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  next_device_proc = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;

  VkDeviceCreateInfo copy = *info;
  const char** kept = calloc(info->enabledExtensionCount + 1, sizeof(*kept));
  if (!kept) return VK_ERROR_OUT_OF_HOST_MEMORY;
  copy.enabledExtensionCount =
      keep_others(info->ppEnabledExtensionNames, info->enabledExtensionCount, kept);
  copy.ppEnabledExtensionNames = kept;
  PFN_vkCreateDevice create = (PFN_vkCreateDevice)instance_proc(NULL, "vkCreateDevice");
  const VkResult result = create(physical, &copy, allocator, device);
  free(kept);
  return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL limitray_GetInstanceProcAddr(VkInstance instance,
                                                                      const char* name) {
  if (strcmp(name, "vkGetInstanceProcAddr") == 0)
    return (PFN_vkVoidFunction)limitray_GetInstanceProcAddr;
  if (strcmp(name, "vkCreateInstance") == 0) return (PFN_vkVoidFunction)create_instance;
  if (strcmp(name, "vkCreateDevice") == 0) return (PFN_vkVoidFunction)create_device;
  return next_instance_proc ? next_instance_proc(instance, name) : NULL;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL limitray_GetDeviceProcAddr(VkDevice device,
                                                                    const char* name) {
  if (strcmp(name, "vkGetDeviceProcAddr") == 0)
    return (PFN_vkVoidFunction)limitray_GetDeviceProcAddr;
  return next_device_proc ? next_device_proc(device, name) : NULL;
}
